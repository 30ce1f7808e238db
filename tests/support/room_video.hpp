// SPDX-License-Identifier: Apache-2.0
// A video of the room of camera_path.hpp by a camera on an arc, in which the last board moves.
#pragma once
#include <fmt/format.h>

#include "optim/cameras/masks.hpp"
#include "optim/cameras/small_video.hpp"
#include "tests/support/camera_path.hpp"

namespace gflow {

struct RoomVideo {
  static constexpr int frames = 16, width = 160, height = 120;
  static constexpr double focal = 130;

  // The board is displaced by step * k in frame k.
  explicit RoomVideo(const Eigen::Vector3d& step) {
    all.resize(frames);
    for (int k = 0; k < frames; ++k) {
      const Eigen::Isometry3d pose = pose_on_arc(22 + k, 60);
      RoomTruth seen, behind;
      video.images.push_back(
          image_of_room(pose, focal, width, height, Eigen::Vector3d(step * k), &seen));
      image_of_room(pose, focal, width, height, {}, &behind, true);
      Camera camera;
      camera.width = width, camera.height = height;
      camera.fx = camera.fy = focal, camera.cx = width / 2., camera.cy = height / 2.;
      camera.viewmat = pose.matrix();
      video.cameras.push_back(camera);
      Frame& frame = all[size_t(k)];
      frame.camera = frame.step = k;
      frame.time = double(k) / (frames - 1);
      frame.name = fmt::format("frame_{:02}", k);
      frame.image = std::make_shared<const Image>(video.images.back());
      video.frames.push_back(&frame);
      Mask mask(width, height);
      mask.pixels = seen.last;
      moving.push_back(mask);
      depths_behind.push_back(behind.depth);
      depths.push_back(seen.depth);
    }
  }
  RoomVideo(const RoomVideo&) = delete;

  std::vector<Frame> all;
  SmallVideo video;
  std::vector<Mask> moving;                       // the board
  std::vector<std::vector<float>> depths;         // with the board
  std::vector<std::vector<float>> depths_behind;  // without it
};

// Intersection over union of masks, over all frames.
inline double overlap(const std::vector<Mask>& a, const std::vector<Mask>& b) {
  size_t both = 0, any = 0;
  for (size_t k = 0; k < a.size(); ++k)
    for (size_t i = 0; i < a[k].pixels.size(); ++i) {
      both += a[k].pixels[i] && b[k].pixels[i];
      any += a[k].pixels[i] || b[k].pixels[i];
    }
  return double(both) / double(any);
}

}  // namespace gflow
