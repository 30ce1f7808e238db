// SPDX-License-Identifier: Apache-2.0
// Guidance: someone who looks at views that nobody filmed and says how they should change. Rendered
// views, cameras and time go in; for each view the gradient of a loss by its picture comes out, and
// if asked for the flow it should show. Who that is - a diffusion model in another process, a
// network, a formula - the training does not know.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"
#include "runtime/base/error.hpp"

namespace gflow {

// A view nobody filmed. Pictures are planes, row by row, sRGB as stored, 0 to 1 (what is drawn may
// exceed it a little).
struct GuidanceView {
  Camera camera;  // its name is that of a camera of the scene, or empty when it was drawn by lot
  // Where it stands as seen from the reference camera, about what both look at: to the right
  // (counter-clockwise from above), upwards [degrees], and further away [scene units].
  double azimuth = 0, elevation = 0, distance = 0;
  std::vector<float> rgb;   // [3, H, W] rendered, on the background
  std::vector<float> flow;  // [2, H, W] rendered, to next_time [px]; empty unless flow is wanted
};

// A picture that was filmed at the same time, for providers that need one.
struct GuidanceReference {
  Camera camera;
  std::vector<float> rgb;  // [3, H, W] on the background
};

struct GuidanceRequest {
  int step = 0, steps = 0;  // of the training
  double progress = 0;      // [0, 1] share of the steps with guidance that is over
  uint32_t seed = 0;        // of every random choice of this step
  double time = 0;          // [0, 1] of all pictures here
  int frame = 0;            // number of the time step on disk, from 0
  bool wants_flow = false;  // whether flow is of use
  double next_time = 0;     // [0, 1] where the flow leads to: the next time step that is used
  int next_frame = 0;       // its number, as `frame`
  std::array<float, 3> background = {1, 1, 1};
  GuidanceReference reference;
  std::vector<GuidanceView> views;
};

// What is wanted of one view.
struct GuidanceAnswer {
  float weight = 1;                 // of the gradient beside that of other views, at least 0
  std::vector<float> gradient;      // [3, H, W] dL/d rgb, where L is a sum over pixels; empty: none
  float flow_weight = 1;            // of the flow, at least 0
  std::vector<float> flow;          // [2, H, W] to be matched [px]; empty: none
  std::vector<uint8_t> confidence;  // [H, W] of the flow, 255 = 1; empty: 255 everywhere
};

// The provider could not answer; the training is what it was before the step.
struct GuidanceFailed : Error {
  using Error::Error;
};

class Guidance {
 public:
  virtual ~Guidance() = default;
  // An answer a view, in order. A provider that is a function of the request alone keeps the
  // training repeatable. GuidanceFailed with a full sentence when there is none.
  virtual std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) = 0;
  // For messages, e.g. "the guidance program `python3 zero123.py`".
  virtual std::string name() const = 0;
};

// GuidanceFailed unless there is an answer a view, of the right sizes, with finite gradients and
// weights of at least 0. Flow that is not finite is no error: it has no weight.
void require_usable(const GuidanceRequest& request, const std::vector<GuidanceAnswer>& answers,
                    const std::string& provider);

}  // namespace gflow
