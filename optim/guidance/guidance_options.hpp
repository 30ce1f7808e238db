// SPDX-License-Identifier: Apache-2.0
// Guidance of novel views (settings guidance.*).
#pragma once
#include <array>
#include <string>

#include "runtime/base/option.hpp"

namespace gflow {

enum class GuidanceProvider { none, process, onnx, analytic };
constexpr std::array<const char*, 4> names_of(GuidanceProvider) {
  return {"none", "process", "onnx", "analytic"};
}
enum class GuidanceCameras { orbit, test, val };
constexpr std::array<const char*, 3> names_of(GuidanceCameras) { return {"orbit", "test", "val"}; }
enum class UpAxis { automatic, cameras, x, y, z };
constexpr std::array<const char*, 5> names_of(UpAxis) { return {"auto", "cameras", "x", "y", "z"}; }
enum class NoiseKind { scaled_linear, linear };
constexpr std::array<const char*, 2> names_of(NoiseKind) { return {"scaled_linear", "linear"}; }

struct GuidanceOptions {
  GuidanceProvider provider = GuidanceProvider::none;
  std::string command;
  std::string model;
  std::string images;
  float timeout = 300;
  float weight = 0.1f;
  float flow = 0;
  int every = 1;
  int start = 0;
  int stop = 0;
  int views = 1;
  GuidanceCameras cameras = GuidanceCameras::orbit;
  float azimuth = 180;
  float elevation = 0;
  UpAxis up = UpAxis::automatic;
  int size = 0;
  float scale = 1;
  float t_min = 0.02f;
  float t_max = 0.98f;
  float t_max_final = 0.02f;
  float variance = 1e-3f;
  NoiseKind schedule = NoiseKind::scaled_linear;
  int timesteps = 1000;
  float beta_start = 0.00085f;
  float beta_end = 0.012f;

  bool enabled() const { return provider != GuidanceProvider::none; }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("provider", self.provider,
          "supervision of novel views: process: a program (command); onnx: a denoiser (model); "
          "analytic: images of a folder (images)");
    field("command", self.command, "process: shell command; apps/guidance/README.md");
    field("model", self.model, "onnx: network file; optim/guidance/README.md");
    field("images", self.images,
          "analytic: a folder with CAMERA/ per known view, flow/CAMERA/, or images of any view; "
          "empty: the scene's");
    field("timeout", self.timeout, "process: longest wait for the start and for each answer [s]",
          above_up_to(0, 1e6f));
    field("weight", self.weight,
          "weight of the provider's loss, a mean over pixels, relative to the image loss",
          at_least(0));
    field("flow", self.flow,
          "weight of the flow that the provider requests for these views; 0: not requested",
          at_least(0));
    field("every", self.every, "training steps per step with guidance", at_least(1));
    field("start", self.start, "first step with guidance", at_least(0));
    field("stop", self.stop, "first step without guidance again; 0: until the end", at_least(0));
    field("views", self.views, "views per step with guidance; the weights apply to their mean",
          between(1, 64));
    field("cameras", self.cameras,
          "orbit: the training camera rotated about its subject; test, val: cameras of that split, "
          "to test a provider that knows them");
    field("azimuth", self.azimuth,
          "orbit: largest rotation to either side, drawn uniformly [degrees]", between(0, 180));
    field("elevation", self.elevation,
          "orbit: largest rotation up or down, drawn uniformly [degrees]", between(0, 90));
    field("up", self.up,
          "orbit: rotation axis; auto: z where the layout defines it (Consistent4D, video, D-NeRF, "
          "Blender), else cameras; cameras: their mean");
    field("size", self.size,
          "side of the square images, which contain the training camera's image [px]; 0: as in "
          "training",
          between(0, 4096));
    field("scale", self.scale,
          advanced("onnx, analytic: s in noise = unconditional + s (conditional - unconditional)"),
          at_least(0));
    field("t_min", self.t_min, advanced("lowest noise level [share of the timesteps]"),
          between(0, 1));
    field("t_max", self.t_max,
          advanced("highest noise level at the first step with guidance; decreases linearly"),
          between(0, 1));
    field("t_max_final", self.t_max_final, advanced("highest noise level at the last step"),
          between(0, 1));
    field("variance", self.variance,
          advanced("analytic: variance of the values of a known image, which are -1 to 1"),
          at_least(0));
    field("schedule", self.schedule, advanced("onnx, analytic: noise schedule over the timesteps"));
    field("timesteps", self.timesteps, advanced("onnx, analytic: number of timesteps"),
          between(2, 100000));
    field("beta_start", self.beta_start,
          advanced("onnx, analytic: variance added at the first timestep"), above_up_to(0, 0.999f));
    field("beta_end", self.beta_end,
          advanced("onnx, analytic: variance added at the last timestep, at least beta_start"),
          above_up_to(0, 0.999f));
  }
};

}  // namespace gflow
