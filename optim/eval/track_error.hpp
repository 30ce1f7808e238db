// SPDX-License-Identifier: Apache-2.0
// 3D tracking error: how far a model's motion carries points away from their true paths.
#pragma once
#include <optional>

#include "optim/model/model.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Paths of `points` points over `steps` equally spaced time steps, xyz [steps, points, 3] in world
// units.
struct Tracks {
  size_t steps = 0, points = 0;
  std::vector<float> xyz;
  // Whether a training camera sees the point in this step and the next, [steps - 1, points]; empty
  // if unknown.
  std::vector<uint8_t> seen;
};
// Reads tracks, relative to `origin` in the file's world. Error if the file contains no such array.
Tracks read_tracks(const std::string& path, const std::array<double, 3>& origin = {0, 0, 0});

// Sets `seen` if all training images but the last ones have true flow. A point is seen if the flow
// around its pixel agrees with its motion to 0.3 px and 2 %, and it is not hidden at the next step.
// Error if a flow cannot be read.
void mark_seen(Tracks& tracks, const Scene& scene, const FrameStore& frames);

struct TrackError {
  double mean = 0;    // distance from the true path, over all points and later steps [scene units]
  double median = 0;  // median over the points of their mean distance
  double end = 0;     // mean distance at the last step
  std::vector<double> by_step;  // mean over the points at each step, 0 at the first
  // Error of single steps that start at the true position: error of the motion alone, without
  // drift. Mean over all points and steps; motion_by_step: of the step that leads to each time
  // step, NaN for the first.
  double motion = 0;
  std::vector<double> motion_by_step;
  double still = 0;  // mean distance if the points did not move, for comparison
  double lost = 0;   // share of the steps in which no Gaussian carries the point
  // The same for visible motion, if it is known and there is any: no image shows how the far side
  // of an object moves.
  struct Seen {
    double share = 0;   // seen share of all steps of all points
    double mean = 0;    // over points while they have been seen in every step so far
    double motion = 0;  // over the seen steps
    std::vector<double> by_step, motion_by_step;  // as above; NaN if none is seen
  };
  std::optional<Seen> seen;
  // Median over the points of their mean distance, as `median`, if each point starts where the model
  // shows it: images of one camera at a time do not tell how far away a thing that moves is.
  std::optional<double> from_view;
};

// Error of a model's motion against tracks. Each point starts at its true position and is carried
// from step to step by the Gaussians around it, each by its own affine motion L(t') L(t)^-1,
// weighted by their share of the density there. So a point may pass from one short-lived Gaussian
// to the next.
TrackError track_error(Queue& queue, Model& model, const Tracks& tracks);

// TrackError::from_view: points in view of the camera start at the depth that the model shows in
// their pixels at the first step. `near`: from where Gaussians are drawn. The others start at their
// true positions.
double track_error_from_view(Queue& queue, Model& model, const Tracks& tracks, const Camera& camera,
                             float near);

}  // namespace gflow
