// SPDX-License-Identifier: Apache-2.0
// Views of a rendering: those of a split, cameras at chosen times, or an orbit if there are no
// cameras.
#pragma once
#include <string>
#include <vector>

#include "optim/model/model.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// One view to render. Frames point into the scene that it was made from.
struct RenderView {
  std::string name;                 // base name of its files, unique in a rendering
  std::string movie;                // views with the same name form a video, in order
  Camera camera;                    // at the rendered size
  Camera camera_t2;                 // camera at time_t2, for the end of the flow
  double time = 0;                  // [0, 1]
  double time_t2 = -1;              // target time of the flow; negative: no flow
  const Frame* truth = nullptr;     // the scene's image of this view, or null
  const Frame* truth_t2 = nullptr;  // the scene's image of camera_t2 at time_t2, or null
};

// Parses times in [0, 1]: "0:1:40" is 40 times from 0 to 1, "0,0.25,1" a list. Error that shows
// both forms if it is neither.
std::vector<double> parse_times(const std::string& text);
// Distinct times of the training frames, ascending.
std::vector<double> step_times(const Scene& scene);

// Views of the frames of a split (such as scene.test). cameras: the scene's, at the rendered size.
// Flow leads to the target of the true flow, else to the next frame of the camera track and its
// camera, else one time step ahead. Each static camera has its own video. Moving cameras and those
// with fewer than four frames share one named `split`; if all share it, the views are in order of
// time.
std::vector<RenderView> split_views(const Scene& scene, const std::vector<Frame>& frames,
                                    const std::vector<Camera>& cameras, const std::string& split);

// Views of static cameras at all of the times; flow leads to the next time. With a scene, `cameras`
// are some of its cameras: views get their images if a frame has the same camera and time, and flow
// of a single time leads one time step ahead.
std::vector<RenderView> camera_views(const std::vector<Camera>& cameras,
                                     const std::vector<double>& times, const Scene* scene);

// One orbit around the Gaussians, 640x480, from 15 degrees above. The target is a ball that just
// fills the view: its centre and radius are the middle and half the diagonal of the box of the
// means, without 2 % on each side of each axis. `up` is x, y, z or -x, -y, -z; 3DGS scenes made by
// COLMAP have -y up. Flow is that of a static camera.
std::vector<RenderView> orbit_views(const HostModel& model, const std::vector<double>& times,
                                    const std::string& up);

// The views of the first camera track, or of the first static camera, from a camera that circles
// around each of their poses, `degrees` to each side and half as far up and down, once in
// `per_circle` views or in all if they are fewer, and looks at the same point, at the median depth
// of the Gaussians in view. Times at which images are held back are filled in. Flow is that of a
// static camera. They have no images.
std::vector<RenderView> swaying_views(const std::vector<RenderView>& views, const HostModel& model,
                                      double degrees, double per_circle);

}  // namespace gflow
