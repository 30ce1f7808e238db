// SPDX-License-Identifier: Apache-2.0
// A trained or growing scene: its parameters, the motion model and the colour model that read them;
// and its file, a 3DGS PLY with the motion as extra properties.
#pragma once
#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "optim/formats/npz.hpp"
#include "optim/motion/color.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// What must be known before the arrays can be read.
struct ModelShape : MotionShape {
  int sh_degree = 2;  // highest, 0 to 3
  // The place of the world that means are relative to (Scene::origin).
  std::array<double, 3> origin = {0, 0, 0};
};

struct HostModel {
  ModelShape shape;
  size_t count = 0;
  HostGroups groups;
};

// What a model is for: one that is only shown takes a quarter of the device's memory.
enum class Purpose { training, showing };

class Model {
 public:
  // `count` Gaussians of undefined values.
  Model(Queue& queue, const ModelShape& shape, size_t count, Purpose purpose = Purpose::training);
  // Error when a group is missing or has the wrong length.
  Model(Queue& queue, const HostModel& host, Purpose purpose = Purpose::training);

  // Model time of a scene time in [0, 1].
  float time(double scene_time) const { return float(scene_time * shape.duration); }
  HostModel read(Queue& queue) const;

  ModelShape shape;
  std::unique_ptr<Motion> motion;
  Color color;
  Parameters parameters;
};

// The model that a checkpoint's arrays (Trainer::state) hold, read without a device. shape: that of
// the training's models. Error that names the array when one is missing or has another shape.
HostModel model_of_state(const ModelShape& shape, const Arrays& arrays, const std::string& path);

// Standard 3DGS properties (x y z, nx ny nz, f_dc_*, f_rest_*, opacity, scale_*, rot_*) and for the
// motion t, scale_t, and rot_r_0..3 (native4d) or motion_0..5, omega_0..3 (spacetime; names and
// meaning as Spacetime Gaussians): a viewer of static splats shows each Gaussian at its own moment.
// shape is kept in comments. What has other rows than one a Gaussian stands in a second file beside
// it, tables_path(path). Each file appears complete or not at all.
void write_model(const std::string& path, const HostModel& model);

// "a/b.ply" -> "a/b.motion.npz".
std::string tables_path(const std::string& path);

// Reads what write_model wrote, or any splat file that read_splats reads (then nothing moves).
// Error when properties are missing or values are not finite.
HostModel read_model(const std::string& path);

// Whether every Gaussian lasts for the whole video and none moves.
bool is_static_model(const HostModel& model);

}  // namespace gflow
