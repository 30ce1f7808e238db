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
          "who judges views nobody filmed: process, a program (command); onnx, a denoiser (model); "
          "analytic, pictures of a folder (pictures)");
    field("command", self.command, "process: what the shell starts; apps/guidance/README.md");
    field("model", self.model, "onnx: the network's file; optim/guidance/README.md");
    field("images", self.images,
          "analytic: a folder CAMERA/ for each known view, flow/CAMERA/, or pictures of any view; "
          "empty: the scene's");
    field("timeout", self.timeout, "process: longest wait for its start and each answer [s]",
          above_up_to(0, 1e6f));
    field("weight", self.weight,
          "of the mean over the pixels of what it says, beside the image loss", at_least(0));
    field("flow", self.flow, "weight of the flow it wants these views to show; 0: not asked for",
          at_least(0));
    field("every", self.every, "steps between two with guidance", at_least(1));
    field("start", self.start, "first step with guidance", at_least(0));
    field("stop", self.stop, "first step without it again; 0: up to the end", at_least(0));
    field("views", self.views, "views in such a step; the weights are for their mean",
          between(1, 64));
    field("cameras", self.cameras,
          "orbit: the training camera turned about what it looks at; test, val: those of that "
          "split, to try a provider that knows them");
    field("azimuth", self.azimuth, "orbit: drawn evenly, at most so far to either side [degrees]",
          between(0, 180));
    field("elevation", self.elevation, "orbit: drawn evenly, at most so far up or down [degrees]",
          between(0, 90));
    field("up", self.up,
          "orbit: what it turns about; auto: z where the layout says so (Consistent4D, video, "
          "D-NeRF, Blender), else cameras, their mean");
    field("size", self.size,
          "side of its square pictures, into which the training camera's fits [px]; 0: as those of "
          "the training",
          between(0, 4096));
    field("scale", self.scale,
          advanced("onnx, analytic: s of noise = without + s (with - without the condition)"),
          at_least(0));
    field("t_min", self.t_min, advanced("least noise that is added [share of the timesteps]"),
          between(0, 1));
    field("t_max", self.t_max, advanced("most, at the first step with guidance; it falls evenly"),
          between(0, 1));
    field("t_max_final", self.t_max_final, advanced("to this, at the last"), between(0, 1));
    field("variance", self.variance,
          advanced("analytic: of a known picture's values, which go from -1 to 1"), at_least(0));
    field("schedule", self.schedule,
          advanced("onnx, analytic: how the noise grows with the timestep"));
    field("timesteps", self.timesteps, advanced("onnx, analytic: how many there are"),
          between(2, 100000));
    field("beta_start", self.beta_start, advanced("onnx, analytic: variance added at the first"),
          above_up_to(0, 0.999f));
    field("beta_end", self.beta_end, advanced("onnx, analytic: at the last, no less"),
          above_up_to(0, 0.999f));
  }
};

}  // namespace gflow
