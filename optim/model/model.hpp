// SPDX-License-Identifier: Apache-2.0
// A model: its parameters, the motion model and colour model that read them, and its file, a 3DGS
// PLY with the motion as extra properties.
#pragma once
#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "optim/formats/npz.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/motion/color.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// Everything that defines the arrays of a model.
struct ModelShape : MotionShape {
  int sh_degree = 2;  // highest degree, 0 to 3
  // World position that means are relative to (Scene::origin).
  std::array<double, 3> origin = {0, 0, 0};
};

// The groups with a row per Gaussian; others are in motion_tables().
std::vector<GroupSpec> model_groups(const ModelShape& shape);

struct HostModel {
  ModelShape shape;
  size_t count = 0;
  HostGroups groups;
  // The first ones are dynamic, the others static (Parameters); at most `count` counts.
  size_t moving = Parameters::all;

  size_t num_moving() const { return std::min(moving, count); }
};

// The longest standard deviation of a Gaussian at rest [scene units].
double longest_scale(const HostModel& model, size_t i);

// Purpose of a model; without training state it takes a quarter of the memory.
enum class Purpose { training, rendering };

class Model {
 public:
  // `count` Gaussians with undefined values, the first `moving` of them dynamic.
  Model(Queue& queue, const ModelShape& shape, size_t count, Purpose purpose = Purpose::training,
        size_t moving = Parameters::all);
  // Error if a group is missing or has the wrong length.
  Model(Queue& queue, const HostModel& host, Purpose purpose = Purpose::training);

  // Model time of a scene time in [0, 1].
  float time(double scene_time) const { return float(scene_time * shape.duration); }
  HostModel read(Queue& queue) const;

  // A training step for programs with a loop of their own (the trainer uses Optimizer): before the
  // first backward pass, and one Adam step of every group after the last.
  void begin_step(Queue& queue) { parameters.forget_seen(queue); }
  void step(Queue& queue, Adam& adam, const AdamRate& rate);

  ModelShape shape;
  std::unique_ptr<Motion> motion;
  Color color;
  Parameters parameters;
};

// The model in a checkpoint's arrays (Trainer::state), without a device. shape: that of the run.
// Error that names the array if one is missing or has another shape; `path`: the file, for
// messages.
HostModel model_of_state(const ModelShape& shape, const Arrays& arrays, const std::string& path);

// Writes a PLY with the standard 3DGS properties (x y z, nx ny nz, f_dc_*, f_rest_*, opacity,
// scale_*, rot_*). Motion is stored as t, scale_t, and rot_r_0..3 (native4d) or motion_0..5,
// omega_0..3 (spacetime; names and meaning as in Spacetime Gaussians); where Gaussians share their
// motion and some do not move, as `moves`, 1 or 0. A viewer of static splats
// shows each Gaussian at its temporal mean. `shape` is stored in comments. Tables with other rows
// than one per Gaussian go into a second file, tables_path(path). Each file appears complete or not
// at all.
void write_model(const std::string& path, const HostModel& model);

// "a/b.ply" -> "a/b.motion.npz".
std::string tables_path(const std::string& path);

// Reads a file of write_model, or any splat file that read_splats reads (then all Gaussians are
// static). Error if properties are missing, or if a file of write_model has non-finite values.
HostModel read_model(const std::string& path, Undrawable undrawable = Undrawable::left_out);

// Whether every Gaussian lasts for the whole video and none moves.
bool is_static_model(const HostModel& model);

}  // namespace gflow
