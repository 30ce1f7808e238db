// SPDX-License-Identifier: Apache-2.0
// Guidance: gradients for novel views that have no ground truth. Input: rendered views, cameras and
// time. Output per view: the gradient of a loss with respect to the image and, if wanted, a target
// flow. The provider may be a diffusion model in another process, a network or a formula.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"
#include "runtime/base/error.hpp"

namespace gflow {

// A novel view. Images are planar, sRGB as stored, in [0, 1]; rendered values may exceed that
// slightly.
struct GuidanceView {
  Camera camera;  // its name is that of a scene camera, or empty for a random camera
  // Position relative to the reference camera, on an orbit about the point both look at: azimuth to
  // the right (counter-clockwise from above), elevation upwards [degrees], additional distance
  // [scene units].
  double azimuth = 0, elevation = 0, distance = 0;
  std::vector<float> rgb;   // [3, H, W]; rendered, over the background
  std::vector<float> flow;  // [2, H, W]; rendered flow to next_time [px]; empty unless wants_flow
};

// A ground-truth image at the same time, for providers that need one.
struct GuidanceReference {
  Camera camera;
  std::vector<float> rgb;  // [3, H, W]; over the background
};

struct GuidanceRequest {
  int step = 0, steps = 0;  // of the training
  double progress = 0;      // [0, 1]; fraction of the guided steps done
  uint32_t seed = 0;        // for all random choices of this step
  double time = 0;          // [0, 1]; time of all images here
  int frame = 0;            // index of the time step on disk, from 0
  bool wants_flow = false;  // whether a target flow can be used
  double next_time = 0;     // [0, 1]; target time of the flow: the next time step in use
  int next_frame = 0;       // its index, as `frame`
  std::array<float, 3> background = {1, 1, 1};
  GuidanceReference reference;
  std::vector<GuidanceView> views;
};

// The answer for one view.
struct GuidanceAnswer {
  float weight = 1;                 // weight of the gradient relative to other views, >= 0
  std::vector<float> gradient;      // [3, H, W]; dL/d rgb for L summed over pixels; empty: none
  float flow_weight = 1;            // weight of the flow, >= 0
  std::vector<float> flow;          // [2, H, W]; target flow [px]; empty: none
  std::vector<uint8_t> confidence;  // [H, W]; of the flow, 255 = 1; empty: 255 everywhere
};

// The provider could not answer. Training is in the state before the step.
struct GuidanceFailed : Error {
  using Error::Error;
};

class Guidance {
 public:
  virtual ~Guidance() = default;
  // One answer per view, in order. Training stays repeatable if the answer depends only on the
  // request. GuidanceFailed with a full sentence if there is no answer.
  virtual std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) = 0;
  // For messages, e.g. "the guidance program `python3 zero123.py`".
  virtual std::string name() const = 0;
};

// GuidanceFailed unless there is one answer per view with matching sizes, finite gradients and
// weights >= 0. Non-finite flow is allowed and gets no weight.
void require_usable(const GuidanceRequest& request, const std::vector<GuidanceAnswer>& answers,
                    const std::string& provider);

}  // namespace gflow
