// SPDX-License-Identifier: Apache-2.0
// A plain COLMAP folder: the images of a model, a static scene of one time step unless the names of
// the images give times.
#include <fmt/format.h>

#include <filesystem>
#include <set>

#include "optim/images/image_header.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/readers/mask_files.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "optim/scene/readers/times_by_order.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// The image in the folder, or empty if there is none. Reduced copies of images may have another
// extension.
std::string image_file(const std::string& folder, const std::string& name,
                       const std::string& sparse) {
  const std::string path = path_inside(folder, name, sparse);
  if (const std::string found = find_image_of_any_case(path); !found.empty()) return found;
  return find_image_of_any_case(without_image_extension(path));
}

// The folder of the images: images/, or input/, from which 3DGS's convert.py makes images/. Error
// if it does not exist, with the folders that do.
std::string image_folder_of(const std::string& folder, const SceneOptions& options) {
  const std::string path = join(folder, options.images.empty() ? "images" : options.images);
  if (fs::is_directory(path)) return path;
  const std::string input = join(folder, "input");
  if (options.images.empty() && !list_images_below(input).empty()) return input;
  std::string others;
  for (const std::string& name : list_folders(folder))
    if (!list_images(join(folder, name)).empty()) others += (others.empty() ? "" : ", ") + name;
  throw Error(fmt::format("there is no folder {} for the images of {}{}", path, folder,
                          others.empty() ? "" : "; scene.images selects another: " + others));
}

// A notice if the folder has images other than those in use.
void report_unregistered(const std::string& folder, const std::string& sparse,
                         const std::set<std::string>& used, std::vector<std::string>& notices) {
  size_t all = 0, unused = 0;
  for (const std::string& name : list_images_below(folder)) ++all, unused += !used.count(name);
  if (unused > 0)
    notices.push_back(
        fmt::format("{} of {} images in {} are left out: they are not registered in {}", unused,
                    all, folder, sparse));
}

// The points of the model, else a point cloud in the folder of the scene.
PointCloud points_of(const std::string& folder, const std::string& sparse, const ColmapModel& model,
                     std::vector<std::string>& notices) {
  if (model.points.size() > 0) return model.points;
  const std::string ply = find_points_ply(folder);
  if (!ply.empty()) return read_point_cloud(ply);
  if (first_existing(sparse, {"points3D.bin", "points3D.txt", "points3D.ply"}).empty())
    notices.push_back(
        fmt::format("COLMAP model {} has no points3D file: starting without its points", sparse));
  return {};
}

bool is_test(size_t image, const SceneOptions& options) {
  return options.test_every > 0 && image % size_t(options.test_every) == 0;
}

}  // namespace

bool is_colmap(const std::string& folder) { return !find_sparse(folder).empty(); }

Scene read_colmap(const std::string& folder, const SceneOptions& options) {
  Scene scene;
  const std::string sparse = find_colmap_model(find_sparse(folder), scene.notices);
  const ColmapModel model = read_colmap_model(sparse);
  const std::string image_folder = image_folder_of(folder, options);
  scene.layout = "colmap";
  scene.fps = 24;
  std::vector<Frame> frames;
  std::set<std::string> used;
  LeftOut missing("without an image file");
  for (const ColmapImage& image : model.images) {
    Frame frame;
    frame.path = image_file(image_folder, image.name, sparse);
    if (frame.path.empty()) {
      missing.add(image.name);
      continue;
    }
    const std::string relative =
        fs::path(frame.path).lexically_relative(image_folder).generic_string();
    if (!used.insert(relative).second)
      throw Error(fmt::format("{} lists image {} twice", sparse, image.name));
    const ImageHeader header = read_image_header(frame.path);
    scene.has_alpha |= header.has_alpha;
    if (options.masks != Masks::none) frame.mask_path = find_mask(folder, relative, sparse);
    scene.has_alpha |= !frame.mask_path.empty() && options.masks == Masks::alpha;
    frame.name = fs::path(image.name).replace_extension().generic_string();
    frame.camera = frame.track = int(frames.size());
    scene.cameras.push_back(
        fitted_to(image.camera, header.width, header.height, sparse, frame.path));
    frames.push_back(frame);
  }
  missing.report(model.images.size(), sparse, scene.notices);
  if (options.times == Times::order)
    set_times_by_order(frames, sparse);
  else
    report_video_names(frames, sparse, scene.notices);
  for (size_t i = 0; i < frames.size(); ++i)
    (is_test(i, options) ? scene.test : scene.train).push_back(frames[i]);
  if (options.masks != Masks::none)
    report_unused_masks(folder,
                        "none is named like an image (expected NAME.png, NAME.jpg.png, "
                        "NAME_mask.png or mask_NAME.png)",
                        scene);
  report_unregistered(image_folder, sparse, used, scene.notices);
  scene.points = points_of(folder, sparse, model, scene.notices);
  return scene;
}

}  // namespace gflow
