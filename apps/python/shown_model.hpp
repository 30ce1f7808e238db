// SPDX-License-Identifier: Apache-2.0
// gflow.Model on plain memory: a model on the host and, once it is shown, on the device.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/python/devices.hpp"
#include "optim/model/model.hpp"
#include "optim/model/renderer.hpp"
#include "optim/options/train_options.hpp"

namespace gflow::python {

// Every Gaussian of a model at one time, whether it is visible then or not, so that row i is
// Gaussian i at any time.
struct Poses {
  std::vector<float> means;      // [N, 3] world
  std::vector<float> quats;      // [N, 4] w x y z
  std::vector<float> scales;     // [N, 3]
  std::vector<float> opacities;  // [N]; 0 outside of a Gaussian's time window
};

// Images of a camera, row by row.
struct Pictures {
  std::vector<float> colors;  // [H, W, 3]
  std::vector<float> alphas;  // [H, W]
  std::vector<float> depth;   // [H, W] expected depth [scene units], 0 where nothing is drawn
  std::vector<float> flow;    // [H, W, 2] [px], or empty
};

class ShownModel {
 public:
  // config: settings of its run; near: nearer Gaussians are not drawn [scene units].
  ShownModel(HostModel host, TrainOptions config, float near);
  // A splat file, or the latest or given iteration of a run folder. Error if there is none.
  static ShownModel load(const std::string& path, int iteration);
  ~ShownModel();
  ShownModel(ShownModel&&) = default;

  // time: scene time in [0, 1].
  Poses at(double time);
  // With flow the camera moves to camera_t2 at time_t2.
  Pictures render(const Camera& camera, double time, std::optional<double> time_t2,
                  const Camera& camera_t2, const std::array<float, 3>& background,
                  std::optional<float> near);

  const HostModel& host() const { return host_; }
  float near() const { return near_; }
  // Which model of a run this is; empty for others.
  const std::string& state() const { return state_; }

 private:
  // On the device that is in use. Called with its lock.
  Model& on(Device& device);

  HostModel host_;
  EngineSettings settings_;
  float near_;
  std::string state_;
  Device* device_ = nullptr;  // of the next two
  std::unique_ptr<Model> model_;
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace gflow::python
