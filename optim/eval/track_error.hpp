// SPDX-License-Identifier: Apache-2.0
// How far a model's motion carries points away from their true paths in space.
#pragma once
#include <optional>

#include "optim/model/model.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Paths of `points` points over `steps` equal steps of the video, xyz [steps, points, 3], world.
struct Tracks {
  size_t steps = 0, points = 0;
  std::vector<float> xyz;
  // Whether a training camera sees the point in this step and the next, [steps - 1, points]; empty
  // where nobody knows.
  std::vector<uint8_t> seen;
};
// Relative to `origin` of the file's world. Error when the file holds no such array.
Tracks read_tracks(const std::string& path, const std::array<double, 3>& origin = {0, 0, 0});

// Fills `seen` where all training pictures but the last ones have true flow: a point is seen where
// the flow around its pixel moves as the point does, to .3 px and 2 %, and is not hidden at the
// next step. Error when a flow cannot be read.
void mark_seen(Tracks& tracks, const Scene& scene, const FrameStore& frames);

struct TrackError {
  double mean = 0;    // distance from the true path, over all points and later steps [scene units]
  double median = 0;  // over the points, of their mean
  double end = 0;     // at the last step: how far it has drifted by then
  std::vector<double> by_step;  // mean over the points at each step, 0 at the first
  // How far a step leads from the truth when it begins there: error of the motion alone, which
  // does not add up. Mean over all points and steps; by_step: of the step that leads there, which
  // is NaN for the first.
  double motion = 0;
  std::vector<double> motion_by_step;
  double still = 0;  // mean for points that never move, for comparison
  double lost = 0;   // share of the steps at which no Gaussian was there to carry a point
  // The same for what training could see, where that is known and anything is: no picture says how
  // the far side of a thing moves.
  struct Seen {
    double share = 0;   // of all steps of all points
    double mean = 0;    // of points for as long as they have been seen in every step
    double motion = 0;  // of these steps
    std::vector<double> by_step, motion_by_step;  // as above; NaN where none is seen
  };
  std::optional<Seen> seen;
};

// Each point starts on its true place and is carried from step to step by the Gaussians around it
// as material is, each by its own affine motion L(t') L(t)^-1, by the share they have in the
// density there: a point may be handed from one short-lived Gaussian to the next.
TrackError track_error(Queue& queue, Model& model, const Tracks& tracks);

}  // namespace gflow
