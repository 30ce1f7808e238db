// SPDX-License-Identifier: Apache-2.0
// The small scene far from the origin of its world, as in surveys.
#pragma once
#include <array>
#include <filesystem>

#include "apps/stress/training/small_training.hpp"
#include "optim/formats/npy.hpp"
#include "optim/formats/ply.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {

using Place = std::array<double, 3>;

// A copy of the scene in a folder, moved by `away`, with positions as doubles.
class FarScene {
 public:
  FarScene(const SmallScene& scene, const Place& away, bool with_points = true) {
    std::filesystem::copy(scene.path(), folder_.path(),
                          std::filesystem::copy_options::recursive |
                              std::filesystem::copy_options::overwrite_existing);
    Array poses = read_npy(folder_.file("poses_bounds.npy"));
    std::vector<double> rows = poses.as_double();
    for (size_t camera = 0; camera < rows.size() / 17; ++camera)
      for (size_t axis = 0; axis < 3; ++axis) rows[17 * camera + 5 * axis + 3] += away[axis];
    write_npy(folder_.file("poses_bounds.npy"), {poses.shape, rows});
    if (!with_points) {
      std::filesystem::remove(folder_.file("points3D.ply"));
      return;
    }
    const PointCloud near = read_point_cloud(folder_.file("points3D.ply"));
    PlyTable far;
    far.rows = near.size();
    far.names = {"x", "y", "z", "red", "green", "blue"};
    far.origin = away;
    for (size_t i = 0; i < near.size(); ++i) {
      for (size_t axis = 0; axis < 3; ++axis) far.values.push_back(float(near.xyz[3 * i + axis]));
      for (size_t c = 0; c < 3; ++c) far.values.push_back(float(near.rgb[3 * i + c]) / 255);
    }
    write_ply(folder_.file("points3D.ply"), far);
  }
  const std::string& path() const { return folder_.path(); }

 private:
  const ScratchFolder folder_{"stress"};
};

}  // namespace gflow
