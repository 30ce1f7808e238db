// SPDX-License-Identifier: Apache-2.0
// Which pictures a rendering consists of: the views of a split, cameras at chosen times, or an
// orbit where nothing says from where to look.
#pragma once
#include <string>
#include <vector>

#include "optim/model/model.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// One picture to draw. Frames point into the scene it was made from.
struct RenderView {
  std::string name;                 // of its files, unique in a rendering
  std::string movie;                // views of one name make a video, in order
  Camera camera;                    // in the size that is drawn
  Camera camera_t2;                 // at time_t2: where the flow's end is seen from
  double time = 0;                  // [0, 1]
  double time_t2 = -1;              // where the flow leads; negative: nowhere
  const Frame* truth = nullptr;     // the scene's picture of this view, if there is one
  const Frame* truth_t2 = nullptr;  // and of camera_t2 at time_t2
};

// Times in [0, 1] as users write them: "0:1:40" is 40 times from 0 to 1, "0,0.25,1" a list. Error
// that shows the two ways when it is neither.
std::vector<double> parse_times(const std::string& text);
// Distinct times of the training frames, rising.
std::vector<double> step_times(const Scene& scene);

// The frames of a split (scene.test, say). cameras: the scene's, in the size that is drawn. Flow
// leads to where the true flow does, else to the track's next frame and its camera, else one step
// on in time. One video a camera at rest; moving ones and those with fewer than four frames share
// one named `split`, and where all do, the views come in the order of time.
std::vector<RenderView> split_views(const Scene& scene, const std::vector<Frame>& frames,
                                    const std::vector<Camera>& cameras, const std::string& split);

// Cameras, at rest, at all of the times; flow leads to the next one. With a scene, they are some of
// the scene's, views get their pictures where a frame has the same camera and time, and flow of a
// single time leads one step on.
std::vector<RenderView> camera_views(const std::vector<Camera>& cameras,
                                     const std::vector<double>& times, const Scene* scene);

// One turn around the Gaussians, 640x480: the middle and half the diagonal of the box that holds
// their means but for 2 % on each side and axis are a ball that just fills the view, seen from 15
// degrees above. `up` is x, y, z or -x, -y, -z; 3DGS scenes made by COLMAP have -y up. Flow is seen
// by a camera that rests.
std::vector<RenderView> orbit_views(const HostModel& model, const std::vector<double>& times,
                                    const std::string& up);

}  // namespace gflow
