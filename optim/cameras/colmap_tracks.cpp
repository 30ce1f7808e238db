// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/colmap_tracks.hpp"

#include <algorithm>
#include <map>

#include "optim/cameras/camera_scene.hpp"
#include "optim/scene/readers/colmap_files.hpp"

namespace gflow {
namespace {

// Point id -> frame -> where that frame shows the point [px].
using Observations = std::map<uint64_t, std::map<size_t, Eigen::Vector2d>>;

SharedLens lens_of_model(const std::string& path) {
  ColmapText file(path, "CAMERA_ID SIMPLE_PINHOLE WIDTH HEIGHT F CX CY, or SIMPLE_RADIAL ... K");
  if (!file.next_entry()) throw Error(fmt::format("{} has no camera", path));
  file.number<uint32_t>("the camera id");
  const std::string model(file.word());
  if (model != "SIMPLE_PINHOLE" && model != "SIMPLE_RADIAL")
    file.refuse(fmt::format("has a camera of model {}", excerpt(model)));
  file.number<int>("the width");
  file.number<int>("the height");
  SharedLens lens;
  lens.focal = file.number<double>("the focal length");
  lens.centre.x() = file.number<double>("the principal point");
  lens.centre.y() = file.number<double>("the principal point");
  if (model == "SIMPLE_RADIAL") lens.k1 = file.number<double>("the distortion");
  return lens;
}

Eigen::Isometry3d next_pose(ColmapText& file) {
  double q[4], t[3];
  for (double& value : q) value = file.number<double>("a quaternion component");
  for (double& value : t) value = file.number<double>("a translation component");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
  return pose;
}

// A point seen twice in one image keeps the first place.
void read_observations(ColmapText& file, size_t frame, Observations& seen) {
  if (!file.next_line() || file.is_blank()) return;
  if (!file.is_whole()) file.refuse("is too long");
  for (std::string word(file.word()); !word.empty(); word = file.word()) {
    double x = 0;
    if (std::from_chars(word.data(), word.data() + word.size(), x).ec != std::errc())
      file.refuse(fmt::format("has '{}' as a coordinate", excerpt(word)));
    const double y = file.number<double>("a coordinate");
    const auto point = file.number<int64_t>("a point id");
    if (point >= 0) seen[uint64_t(point)].emplace(frame, Eigen::Vector2d(x, y));
  }
}

Observations read_images(const std::string& path, CameraPath& camera_path) {
  std::map<std::string, size_t> frame_of;
  for (size_t k = 0; k < camera_path.poses.size(); ++k) frame_of[image_name(k)] = k;
  Observations seen;
  ColmapText file(path, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID ...");
  while (file.next_entry()) {
    file.number<uint32_t>("the image id");
    const Eigen::Isometry3d pose = next_pose(file);
    file.number<uint32_t>("the camera id");
    const auto found = frame_of.find(file.rest());
    if (found == frame_of.end())
      file.refuse(fmt::format("names the unknown image {}", excerpt(file.rest())));
    camera_path.poses[found->second] = pose;
    read_observations(file, found->second, seen);
  }
  return seen;
}

void add_track(const std::map<size_t, Eigen::Vector2d>& seen, const Eigen::Vector3d& point,
               TrackedPath& result) {
  FeatureTrack track;
  track.first = int(seen.begin()->first);
  const size_t length = seen.rbegin()->first - seen.begin()->first + 1;
  track.points.resize(length, Eigen::Vector2d::Zero());
  std::vector<bool> used(length);
  for (const auto& [frame, at] : seen) {
    track.points[frame - size_t(track.first)] = at;
    used[frame - size_t(track.first)] = true;
  }
  result.tracks.push_back(std::move(track));
  result.path.points.emplace_back(point);
  result.path.used.push_back(std::move(used));
}

}  // namespace

TrackedPath read_colmap_tracks(const std::string& folder, size_t frames) {
  TrackedPath result;
  result.path.lens = lens_of_model(folder + "/cameras.txt");
  result.path.poses.resize(frames);
  const Observations seen = read_images(folder + "/images.txt", result.path);
  ColmapText file(folder + "/points3D.txt", "POINT3D_ID X Y Z R G B ERROR TRACK");
  while (file.next_entry()) {
    const auto found = seen.find(file.number<uint64_t>("the point id"));
    Eigen::Vector3d point;
    for (double& value : point) value = file.number<double>("a coordinate");
    if (found != seen.end() && found->second.size() >= 2) add_track(found->second, point, result);
  }
  return result;
}

}  // namespace gflow
