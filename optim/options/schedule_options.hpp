// SPDX-License-Identifier: Apache-2.0
// Schedule, learning rates and optimiser (settings train.*, lr.*, adam.*).
#pragma once
#include <cstdint>
#include <string>

#include "optim/motion/motion.hpp"
#include "runtime/base/option.hpp"

namespace gflow {

// Largest seed. Random numbers use 32 bits of it; a float represents this number, and it is
// readable.
constexpr int64_t kGreatestSeed = 2000000000;

struct ScheduleOptions {
  int iterations = 20000;
  int batch = 1;
  int focus = 5;
  bool sequential = false;
  float first_share = 0.3f;
  int64_t seed = 0;
  float minutes = 0;
  int log_every = 100;
  int validate_every = 1000;
  int checkpoint_every = 1000;
  int save_every = 0;
  std::string device;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("iterations", self.iterations, "training steps", at_least(1));
    field("batch", self.batch, "views per step", between(1, 256));
    field("focus", self.focus,
          "steps on the focus region (motion mask of a static camera, or visible object by alpha) "
          "per step on whole images",
          at_least(0));
    field("sequential", self.sequential,
          "fit one time step after the other, as Dynamic 3D Gaussians: the first fits the scene, "
          "each next only moves it (motion.model keyframes, motion.keys 0)");
    field("first_share", self.first_share,
          advanced("sequential: share of train.iterations for the first time step"), between(0, 1));
    field("seed", self.seed, "seed of all random choices", between(0, float(kGreatestSeed)));
    field("minutes", self.minutes,
          "stop after this training time, not repeatably [minutes]; 0: no limit", at_least(0));
    field("log_every", self.log_every, "steps between two log lines", at_least(1));
    field("validate_every", self.validate_every,
          "steps between two measurements of validation views (scene.val_every, or a scene's own); "
          "0: only at the end",
          at_least(0));
    field(
        "checkpoint_every", self.checkpoint_every,
        "steps between two checkpoints for --resume; 0: only when training ends or is interrupted",
        at_least(0));
    field("save_every", self.save_every,
          "steps between two point clouds, point_cloud/iteration_N; 0: only when training ends or "
          "is interrupted",
          at_least(0));
    field("device", self.device,
          "OpenCL device by index or part of its name; empty: GFLOW_DEVICE, else the first GPU, "
          "else the first device");
  }
};
struct LearningRateOptions {
  int steps = 10000;
  float means = 6e-4f;
  float means_final = 6e-6f;
  float mean_t = 1.6e-4f;
  float sh = 2.5e-3f;
  float sh_rest_divisor = 20;
  float opacity = 0.05f;
  float camera_color = 1e-3f;
  float cameras = 3e-4f;
  float cameras_final = 3e-6f;
  float scales = 5e-3f;
  float quats = 1e-3f;
  float quats_final = 1e-4f;
  float weights = 1e-2f;
  float motion = 1;
  float planes = 4e-3f;
  float planes_final = 1e-4f;
  float network = 8e-4f;
  float network_final = 2e-5f;
  float fade = 0.3f;
  float pace = 1;
  float pace_most = 8;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("steps", self.steps,
          advanced("least number of training steps that the rates are for; with fewer, means_final "
                   "grows by steps / train.iterations, at most 3 times; so do scales and quats "
                   "(not of native4d and bases), and all rates of nodes and hexplane; 0: never"),
          at_least(0));
    field("means", self.means, "position at the first step [x scene extent]", at_least(0));
    field("means_final", self.means_final,
          advanced("position at the last step, reached exponentially [x scene extent]"), above(0));
    field("mean_t", self.mean_t, advanced("temporal mean"), at_least(0));
    field("sh", self.sh, "colour, degree 0", at_least(0));
    field("sh_rest_divisor", self.sh_rest_divisor, advanced("divisor of lr.sh for degrees above 0"),
          at_least(1));
    field("opacity", self.opacity, "opacity, before the sigmoid", at_least(0));
    field("camera_color", self.camera_color, advanced("colours of cameras (loss.camera_color)"),
          at_least(0));
    field("cameras", self.cameras,
          advanced("cameras (cameras.refine) at the first step, angles and logarithm of the focal "
                   "length [rad], shifts [x depth of the scene]"),
          at_least(0));
    field("cameras_final", self.cameras_final,
          advanced("cameras at the last step, reached exponentially"), above(0));
    field("scales", self.scales, "logarithm of the scales in space and time", at_least(0));
    field("quats", self.quats, "rotation at the first step (native4d: both quaternions)",
          at_least(0));
    field("quats_final", self.quats_final,
          advanced("rotation at the last step, reached exponentially"), above(0));
    field("weights", self.weights, advanced("blending weights of the bases, before the softmax"),
          at_least(0));
    field("motion", self.motion,
          "multiplier of the learning rates of motion (velocities, accelerations, rotation rates, "
          "keys, bases, hexplane); 1: per step, a Gaussian moves as far at the ends of its "
          "lifetime as in its middle",
          at_least(0));
    field("planes", self.planes, advanced("hexplane planes at the first step"), at_least(0));
    field("planes_final", self.planes_final,
          advanced("hexplane planes at the last step, reached exponentially"), above(0));
    field("network", self.network, advanced("hexplane network at the first step"), at_least(0));
    field("network_final", self.network_final,
          advanced("hexplane network at the last step, reached exponentially"), above(0));
    field("fade", self.fade,
          advanced("rates without a final rate decay exponentially to this over the second half [x "
                   "that before]"),
          above_up_to(0, 1));
    field("pace", self.pace,
          advanced("rates grow with (length of the video / time a Gaussian is visible) to this "
                   "power; 0: off"),
          between(0, 1));
    field("pace_most", self.pace_most,
          advanced("largest factor of lr.pace; less where it would move Gaussians by "
                   "more than 0.3 px in a step"),
          between(1, PaceRule::kMost));
  }
};
// The epsilons bound the step on noise: well below the usual gradient of a group, far above its
// rounding errors. For the Gaussians 1e-8 was chosen over 1e-3 of the usual gradient: quality is
// the same, and the larger value is steadier. For hexplane's planes and network they are the
// smallest that device check T33 allows.
struct AdamOptions {
  // Square root of the smallest normal float. Below it the square of a gradient underflows to 0,
  // and its parameter moves by more than the rate, up to non-finite values.
  static constexpr float kLeastEpsilon = 1.1e-19f;
  float beta1 = 0;
  float beta1_paths = 0.9f;
  float beta2 = 0.999f;
  float eps_means = 1e-8f;
  float eps_sh = 1e-8f;
  float eps_opacity = 1e-8f;
  float eps_scales = 1e-8f;
  float eps_quats = 1e-8f;
  float eps_planes = 1e-10f;
  float eps_network = 1e-7f;

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("beta1", self.beta1,
          advanced("decay of the mean gradient; above 0, parameters that no image shows stay in "
                   "place instead of drifting on"),
          between(0, 0.9994f));
    field("beta1_paths", self.beta1_paths,
          advanced("the same for keys, bases, planes and networks; steps that do not show them are "
                   "ignored"),
          between(0, 0.9994f));
    field("beta2", self.beta2, advanced("decay of the mean squared gradient"), between(0, 0.9994f));
    field("eps_means", self.eps_means, advanced("means in space and time"),
          at_least(kLeastEpsilon));
    field("eps_sh", self.eps_sh, advanced("colour"), at_least(kLeastEpsilon));
    field("eps_opacity", self.eps_opacity, advanced("opacity"), at_least(kLeastEpsilon));
    field("eps_scales", self.eps_scales, advanced("scales in space and time"),
          at_least(kLeastEpsilon));
    field("eps_quats", self.eps_quats, advanced("rotation"), at_least(kLeastEpsilon));
    field("eps_planes", self.eps_planes, advanced("hexplane planes"), at_least(kLeastEpsilon));
    field("eps_network", self.eps_network, advanced("hexplane network"), at_least(kLeastEpsilon));
  }
};

}  // namespace gflow
