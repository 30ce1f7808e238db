// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/camera_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "optim/scene/cameras_json.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using Color = std::array<uint8_t, 3>;

class SceneWriter {
 public:
  SceneWriter(const std::string& folder, const LoadedScene& video,
              const std::vector<FeatureTrack>& tracks, const CameraPath& path)
      : folder_(folder),
        frames_(video.scene.train),
        store_(*video.frames),
        fps_(video.scene.fps),
        tracks_(tracks),
        path_(path) {
    fs::create_directories(folder + "/images");
    fs::create_directories(folder + "/sparse/0");
    colors_.resize(tracks.size());
    for (size_t i = 0; i < tracks.size(); ++i) {
      if (!path.points[i]) continue;
      id_of_.push_back(i);
      shown_in_.push_back(middle_view(i));
    }
  }

  void run(const ProgressCallback& progress) {
    for (size_t k = 0; k < frames_.size(); ++k) {
      if (path_.poses[k]) write_image(k);
      if (progress) progress(k + 1, frames_.size());
    }
    write_colmap();
    write_points();
    write_cameras_json();
    write_transforms();
  }

 private:
  template <class Use>
  void for_views(size_t track, Use&& use) const {
    const FeatureTrack& t = tracks_[track];
    for (int frame = t.first; frame < t.end(); ++frame)
      if (path_.poses[size_t(frame)] && path_.used[track][size_t(frame - t.first)]) use(frame);
  }

  int middle_view(size_t track) const {
    std::vector<int> views;
    for_views(track, [&](int frame) { views.push_back(frame); });
    return views[views.size() / 2];
  }

  void write_image(size_t k) {
    const auto image = store_.rgb(frames_[k]);
    write_png(folder_ + "/images/" + image_name(k), *image);
    for (size_t n = 0; n < id_of_.size(); ++n) {
      if (shown_in_[n] != int(k)) continue;
      const Eigen::Vector2d& p = tracks_[id_of_[n]].at(int(k));
      const int x = std::clamp(int(p.x()), 0, image->width - 1);
      const int y = std::clamp(int(p.y()), 0, image->height - 1);
      const size_t at = 3 * (size_t(y) * size_t(image->width) + size_t(x));
      colors_[id_of_[n]] = {image->pixels[at], image->pixels[at + 1], image->pixels[at + 2]};
    }
  }

  const Camera& size() const { return store_.camera(frames_[0]); }

  // Ids are numbers of frames and points, from 1.
  void write_colmap() const {
    const SharedLens& lens = path_.lens;
    const std::string sparse = folder_ + "/sparse/0/";
    write_file_atomically(
        sparse + "cameras.txt",
        lens.k1 == 0
            ? fmt::format(
                  "# id, model, width, height, f, cx, cy\n1 SIMPLE_PINHOLE {} {} {} {} {}\n",
                  size().width, size().height, lens.focal, lens.centre.x(), lens.centre.y())
            : fmt::format(
                  "# id, model, width, height, f, cx, cy, k\n1 SIMPLE_RADIAL {} {} {} {} {} {}\n",
                  size().width, size().height, lens.focal, lens.centre.x(), lens.centre.y(),
                  lens.k1));
    std::vector<std::string> seen(frames_.size());  // observations of each image
    std::vector<int> count(frames_.size());
    std::string points = "# id, x, y, z, r, g, b, error [px], (image id, observation)...\n";
    for (size_t n = 0; n < id_of_.size(); ++n) {
      const size_t i = id_of_[n];
      const Eigen::Vector3d& p = *path_.points[i];
      std::string views;
      double error = 0;
      int number = 0;
      for_views(i, [&](int frame) {
        const Eigen::Vector2d& at = tracks_[i].at(frame);
        seen[size_t(frame)] += fmt::format("{:.3f} {:.3f} {} ", at.x(), at.y(), n + 1);
        views += fmt::format(" {} {}", frame + 1, count[size_t(frame)]++);
        error += (lens.project(*path_.poses[size_t(frame)] * p) - at).norm();
        ++number;
      });
      const Color& c = colors_[i];
      points += fmt::format("{} {:.9g} {:.9g} {:.9g} {} {} {} {:.3f}{}\n", n + 1, p.x(), p.y(),
                            p.z(), c[0], c[1], c[2], error / number, views);
    }
    write_file_atomically(sparse + "points3D.txt", points);
    write_file_in_pieces(sparse + "images.txt", [&](const Append& append) {
      append(
          "# id, qw, qx, qy, qz, tx, ty, tz, camera, name; then x, y, point of each observation\n");
      for (size_t k = 0; k < frames_.size(); ++k) {
        if (!path_.poses[k]) continue;
        const Eigen::Quaterniond q(path_.poses[k]->rotation());
        const Eigen::Vector3d t = path_.poses[k]->translation();
        append(fmt::format("{} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} 1 {}\n{}\n",
                           k + 1, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), image_name(k),
                           seen[k]));
      }
    });
  }

  void write_points() const {
    std::string text = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "end_header\n",
        id_of_.size());
    for (const size_t i : id_of_) {
      const Eigen::Vector3d& p = *path_.points[i];
      const Color& c = colors_[i];
      text += fmt::format("{:.7g} {:.7g} {:.7g} {} {} {}\n", p.x(), p.y(), p.z(), c[0], c[1], c[2]);
    }
    write_file_atomically(folder_ + "/points3D.ply", text);
  }

  Camera camera_of(size_t k) const {
    Camera camera;
    camera.name = fs::path(image_name(k)).stem().string();
    camera.width = size().width;
    camera.height = size().height;
    camera.fx = camera.fy = path_.lens.focal;
    camera.cx = path_.lens.centre.x();
    camera.cy = path_.lens.centre.y();
    camera.viewmat = path_.poses[k]->matrix();
    return camera;
  }

  void write_cameras_json() const {
    std::vector<Camera> cameras;
    for (size_t k = 0; k < frames_.size(); ++k)
      if (path_.poses[k]) cameras.push_back(camera_of(k));
    write_file_atomically(folder_ + "/cameras.json", cameras_json(cameras));
  }

  // Camera axes there are x right, y up, z backward.
  void write_transforms() const {
    nlohmann::ordered_json json{{"camera_model", "OPENCV"},
                                {"estimated", true},  // this and fps are not of nerfstudio
                                {"fps", fps_},
                                {"w", size().width},
                                {"h", size().height},
                                {"fl_x", path_.lens.focal},
                                {"fl_y", path_.lens.focal},
                                {"cx", path_.lens.centre.x()},
                                {"cy", path_.lens.centre.y()},
                                {"k1", path_.lens.k1},
                                {"ply_file_path", "points3D.ply"},
                                {"frames", nlohmann::ordered_json::array()}};
    for (size_t k = 0; k < frames_.size(); ++k) {
      if (!path_.poses[k]) continue;
      const Eigen::Matrix4d pose =
          path_.poses[k]->inverse().matrix() * Eigen::Vector4d(1, -1, -1, 1).asDiagonal();
      std::vector<std::vector<double>> rows;
      for (int r = 0; r < 4; ++r) rows.push_back({pose(r, 0), pose(r, 1), pose(r, 2), pose(r, 3)});
      json["frames"].push_back({{"file_path", "images/" + image_name(k)},
                                {"time", frames_[k].time},
                                {"transform_matrix", rows}});
    }
    write_file_atomically(folder_ + "/transforms.json", json.dump(1) + "\n");
  }

  const std::string& folder_;
  const std::vector<Frame>& frames_;
  FrameStore& store_;
  double fps_;
  const std::vector<FeatureTrack>& tracks_;
  const CameraPath& path_;
  std::vector<size_t> id_of_;  // track of each point
  std::vector<int> shown_in_;  // frame that gives the point its colour
  std::vector<Color> colors_;  // of each track
};

}  // namespace

std::string image_name(size_t frame) { return fmt::format("{:05}.png", frame); }

void write_camera_scene(const std::string& folder, const LoadedScene& video,
                        const std::vector<FeatureTrack>& tracks, const CameraPath& path,
                        const ProgressCallback& progress) {
  SceneWriter(folder, video, tracks, path).run(progress);
}

}  // namespace gflow
