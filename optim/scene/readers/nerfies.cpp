// SPDX-License-Identifier: Apache-2.0
// nerfies and HyperNeRF captures. In camera/ID.json, orientation is the world-to-camera rotation
// with OpenCV axes and position the camera centre; focal_length, principal_point and distortion are
// those of rgb/1x. The scene is centred and scaled: world = (stored - center) scale. DyCheck's
// captures have lists in splits/, which replace those of dataset.json.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "optim/formats/npy.hpp"
#include "optim/images/image_header.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/lens.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "optim/scene/tracks.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// world = (stored - center) scale
struct World {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double scale = 1;
};

World read_world(const std::string& path) {
  const Json json = read_json(path);
  World world;
  world.scale = needed_number(json, "scale", path);
  if (!(world.scale > 0))
    throw Error(fmt::format("'scale' of {} is {}, expected a positive number", path, world.scale));
  const std::vector<double> center =
      numbers(member(json, "center", path), 3, "'center' of " + path);
  world.center = Eigen::Map<const Eigen::Vector3d>(center.data());
  return world;
}

// rgb/ and options.images, else rgb/Nx with the smallest N, which has the largest images.
std::string rgb_folder_of(const std::string& folder, const SceneOptions& options) {
  const std::string rgb = join(folder, "rgb");
  if (!options.images.empty()) {
    if (!fs::is_directory(join(rgb, options.images)))
      throw Error(fmt::format("there is no folder {} for the images of {}",
                              join(rgb, options.images), folder));
    return join(rgb, options.images);
  }
  for (const std::string& name : list_folders(rgb))  // natural order: 1x, 2x, ..., 16x
    if (name.back() == 'x' && !list_images(join(rgb, name)).empty()) return join(rgb, name);
  throw Error(fmt::format("{} has no images: looked for {}/1x, 2x, ...", folder, rgb));
}

Camera read_camera(const std::string& path, const World& world, const std::string& image,
                   const ImageHeader& header) {
  const Json json = read_json(path);
  const auto list = [&](const char* key, size_t count) {
    return numbers(member(json, key, path), count, fmt::format("'{}' of {}", key, path));
  };
  const std::vector<double> size = list("image_size", 2), centre = list("principal_point", 2);
  Camera camera;
  set_size(camera, size[0], size[1], path);
  camera.fx = needed_number(json, "focal_length", path);
  camera.fy = camera.fx * number(json, "pixel_aspect_ratio", path).value_or(1);
  camera.cx = centre[0], camera.cy = centre[1];
  if (std::fabs(number(json, "skew", path).value_or(0)) > 1e-6 * camera.fx)
    throw Error(fmt::format("'skew' of {} is not 0; cameras with skew are not supported", path));
  const Eigen::Matrix3d orientation =
      matrix(member(json, "orientation", path), 3, 3, "'orientation' of " + path);
  const std::vector<double> position = list("position", 3);
  const Eigen::Vector3d place = Eigen::Map<const Eigen::Vector3d>(position.data());
  camera.viewmat = viewmat_from_pose(orientation.transpose(), world.scale * (place - world.center),
                                     "the pose in " + path);
  camera = fitted_to(camera, header.width, header.height, path, image);
  std::array<double, 8> k = {};
  if (json.contains("radial_distortion")) {
    const std::vector<double> radial = list("radial_distortion", 3);
    k[0] = radial[0], k[1] = radial[1], k[4] = radial[2];
  }
  for (const char* key : {"tangential_distortion", "tangential"})  // "tangential" in older files
    if (json.contains(key)) {
      const std::vector<double> tangential = list(key, 2);
      k[2] = tangential[0], k[3] = tangential[1];
      break;
    }
  return pinhole_of_lens(camera, Lens::Kind::radial, k, path);
}

// The time index of an image in metadata.json.
double time_id(const Json& metadata, const std::string& id, const std::string& path) {
  const std::string where = fmt::format("'{}' of {}", id, path);
  const Json& entry = member(metadata, id, path);
  for (const char* key : {"time_id", "warp_id", "appearance_id"})
    if (const auto value = number(entry, key, where)) return *value;
  throw Error(where + " has none of time_id, warp_id and appearance_id");
}

// The images of a split.
struct ImageList {
  std::string where;  // 'train_ids' of dataset.json
  std::vector<std::string> ids;
  std::vector<double> times;  // as many as ids; empty: those of metadata.json
};

ImageList list_of_dataset(const Json& dataset, const std::string& key, const std::string& path) {
  const std::string where = fmt::format("'{}' of {}", key, path);
  return {where, texts(member(dataset, key, path), where), {}};
}

// splits/train.json and the like: frame_names, time_ids, camera_ids. A time is the warp_id of
// metadata.json; cameras need no number, as each image has its own pose.
ImageList list_of_split(const std::string& path) {
  const Json json = read_json(path);
  ImageList list{fmt::format("'frame_names' of {}", path), {}, {}};
  list.ids = texts(member(json, "frame_names", path), list.where);
  list.times = numbers(member(json, "time_ids", path), list.ids.size(),
                       fmt::format("'time_ids' of {}", path));
  return list;
}

// The training and the test images.
std::pair<ImageList, ImageList> read_lists(const std::string& folder, const Json& dataset,
                                           const std::string& path) {
  const std::string train = first_existing(folder, {"splits/train.json"});
  if (train.empty())
    return {list_of_dataset(dataset, "train_ids", path),
            dataset.contains("val_ids") ? list_of_dataset(dataset, "val_ids", path) : ImageList{}};
  const std::string test = first_existing(folder, {"splits/val.json", "splits/test.json"});
  return {list_of_split(train), test.empty() ? ImageList{} : list_of_split(test)};
}

// Error if an image is listed twice. A notice if dataset.json has images that are in no list.
void check_lists(const ImageList& train, const ImageList& test, const Json& dataset,
                 const std::string& path, std::vector<std::string>& notices) {
  std::map<std::string, std::string> owners;  // image -> its list
  for (const ImageList* list : {&train, &test})
    for (const std::string& id : list->ids)
      if (const auto [owner, is_first] = owners.emplace(id, list->where); !is_first)
        throw Error(
            fmt::format("image '{}' is listed in {} and in {}; each image may be listed only once",
                        excerpt(id), owner->second, list->where));
  if (!dataset.contains("ids")) return;
  const std::string where = fmt::format("'ids' of {}", path);
  const std::vector<std::string> all = texts(dataset["ids"], where);
  std::vector<std::string> unlisted;
  for (const std::string& id : all)
    if (!owners.count(id)) unlisted.push_back(excerpt(id));
  if (!unlisted.empty())
    notices.push_back(
        fmt::format("{} of the {} images in {} are not used ({}): they are not in {}{}",
                    unlisted.size(), all.size(), where, short_list(unlisted, 3), train.where,
                    test.ids.empty() ? "" : " or " + test.where));
}

PointCloud read_points(const std::string& folder, const World& world) {
  const std::string path = join(folder, "points.npy");
  if (!fs::exists(path)) return {};
  const Array array = read_npy(path);
  if (array.shape.size() != 2 || array.shape[1] != 3)
    throw Error(fmt::format("{} has shape {}, expected (points, 3)", path, array.shape_text()));
  const std::vector<double> values = array.as_double();
  PointCloud points;
  points.source = path;
  for (size_t i = 0; i < values.size(); ++i) {
    const double place = world.scale * (values[i] - world.center[long(i % 3)]);
    if (!(std::fabs(place) <= farthest_point))
      throw Error(
          fmt::format("point {} of {}, moved and scaled into the scene, has a coordinate that is "
                      "NaN, Inf or beyond {:g}",
                      i / 3, path, farthest_point));
    points.xyz.push_back(place);
  }
  points.rgb.assign(values.size(), 128);  // the file has no colours
  return points;
}

}  // namespace

bool is_nerfies(const std::string& folder) {
  return fs::exists(fs::path(folder) / "dataset.json") &&
         fs::exists(fs::path(folder) / "metadata.json");
}

Scene read_nerfies(const std::string& folder, const SceneOptions& options) {
  const std::string dataset_path = join(folder, "dataset.json");
  const std::string metadata_path = join(folder, "metadata.json");
  const Json dataset = read_json(dataset_path), metadata = read_json(metadata_path);
  const World world = read_world(join(folder, "scene.json"));
  const std::string image_folder = rgb_folder_of(folder, options);

  Scene scene;
  scene.layout = "nerfies";
  scene.fps = 24;
  const auto [train, test] = read_lists(folder, dataset, dataset_path);
  check_lists(train, test, dataset, dataset_path, scene.notices);
  const auto read_split = [&](const ImageList& list, std::vector<Frame>& frames) {
    for (size_t i = 0; i < list.ids.size(); ++i) {
      const std::string& id = list.ids[i];
      Frame frame;
      const std::string base = path_inside(image_folder, id, list.where);
      frame.path = find_image(base);
      if (frame.path.empty())
        throw Error(
            fmt::format("image '{}' is listed in {}, but there is no {}.png (nor .jpg, ...)",
                        excerpt(id), list.where, base));
      frame.time = list.times.empty() ? time_id(metadata, id, metadata_path) : list.times[i];
      frame.name = id;
      const ImageHeader header = read_image_header(frame.path);
      scene.has_alpha |= header.has_alpha;
      Camera camera =
          read_camera(join(folder, "camera/" + id + ".json"), world, frame.path, header);
      camera.name = id;
      frame.camera = find_or_add(scene.cameras, camera);
      frames.push_back(frame);
    }
  };
  read_split(train, scene.train);
  read_split(test, scene.test);
  if (scene.train.empty())
    throw Error(fmt::format("{} is empty: there are no training images", train.where));

  double first = scene.train[0].time, last = first;
  for (const auto* split : {&scene.train, &scene.test})
    for (const Frame& frame : *split)
      first = std::min(first, frame.time), last = std::max(last, frame.time);
  for (auto* split : {&scene.train, &scene.test})
    for (Frame& frame : *split)
      frame.time = (frame.time - first) / (last > first ? last - first : 1);
  const std::vector<double> times = distinct_times(scene.train);
  scene.steps = int(times.size());
  scene.points = read_points(folder, world);
  for (auto* split : {&scene.train, &scene.test}) {
    set_steps(times, *split);
    find_tracks(scene, *split);
  }
  return scene;
}

}  // namespace gflow
