// SPDX-License-Identifier: Apache-2.0
// Renders views into a folder: images, arrays for scripts, and videos.
//   rgb/NAME.png     colour on the background
//   alpha/NAME.png   opacity
//   depth/NAME.png   16-bit, with NAME.json: {"unit"}: expected depth = value x unit; and NAME.npy
//   flow/NAME.flo    rendered flow to time_t2 [px], unknown where alpha < 1/255; and NAME.png
//   compare/NAME.png truth | render | error x 4 | flow | reference flow, if there is a truth
//   MOVIE.mp4, compare_MOVIE.mp4 of the views that share a movie, two or more of one size
#pragma once
#include <functional>

#include "optim/eval/views.hpp"
#include "optim/formats/flo.hpp"
#include "optim/images/image.hpp"
#include "optim/model/renderer.hpp"
#include "optim/scene/frame_store.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

struct RenderOptions {
  EngineSettings settings;
  std::array<float, 3> background = {1, 1, 1};
  float near = 0.05f;   // [scene units]
  double fps = 24;      // of the videos
  bool compare = true;  // images beside the truth; the reference flow is the scene's, else DIS
};

// A view and its truth.
struct ComparedView {
  Image truth, rendered;      // RGB
  FlowField flow, reference;  // of the model, and of the scene or DIS; not valid in any pixel: none
};
// Renders views that have a truth, one at a time, and passes each on. Error if one has none.
using TakeComparedView = std::function<void(const RenderView& view, ComparedView&& compared)>;
void compare_views(Queue& queue, Model& model, const std::vector<RenderView>& views,
                   FrameStore& frames, const RenderOptions& options, const TakeComparedView& take);

// One view beside its truth: truth | render | error x 4, and flow | reference flow if there is one.
// Error if the view has no truth.
Image comparison_image(Queue& queue, Model& model, const RenderView& view, FrameStore& frames,
                       const RenderOptions& options);

// Counts of what was written, and the paths of the videos, which begin with the folder.
struct RenderReport {
  size_t views = 0, flows = 0, compared = 0;
  std::vector<std::string> movies;
};

// `frames`: images of the scene that the views are from; may be null. All flow images use one
// colour scale: the length that 1 % of the flow exceeds, measured on a few views first. Every file
// appears complete or not at all. `progress` is called after each view.
RenderReport render_views(Queue& queue, Model& model, const std::vector<RenderView>& views,
                          FrameStore* frames, const std::string& folder,
                          const RenderOptions& options, const ProgressCallback& progress);

}  // namespace gflow
