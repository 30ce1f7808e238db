// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/move_cameras.hpp"

#include "optim/scene/similarity.hpp"

namespace gflow {

void move_cameras(const Scene& scene, const std::map<size_t, Eigen::Matrix4d>& poses, double focal,
                  FrameStore& frames) {
  std::vector<Camera> before, after;
  for (const auto& [index, pose] : poses) {
    before.push_back(scene.cameras[index]);
    after.push_back(scene.cameras[index]);
    after.back().viewmat = pose;
  }
  const Similarity map = similarity_between(before, after).value_or(Similarity{});
  for (size_t i = 0; i < scene.cameras.size(); ++i) {
    const auto moved = poses.find(i);
    frames.move_camera(i, moved == poses.end() ? map.pose(scene.cameras[i].viewmat) : moved->second,
                       focal);
  }
}

void undo_fits(const Scene& scene, FrameStore& frames) {
  std::map<size_t, Eigen::Matrix4d> trained;
  for (const Frame& frame : scene.train)
    trained[size_t(frame.camera)] = frames.camera(frame).viewmat;
  const size_t first = trained.begin()->first;
  move_cameras(scene, trained, frames.moved_cameras()[first].fx / scene.cameras[first].fx, frames);
}

}  // namespace gflow
