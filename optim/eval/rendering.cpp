// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/rendering.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "optim/eval/shown_images.hpp"
#include "optim/flow/flow_store.hpp"
#include "optim/formats/npy.hpp"
#include "optim/images/movie.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
constexpr int error_gain = 4;

// One rendered view on the host.
struct Drawn {
  int width = 0, height = 0;
  Image rgb;
  std::vector<float> alpha, depth;
  FlowField flow;  // empty without flow
};

class Painter {
 public:
  Painter(Queue& queue, Model& model, const RenderOptions& options)
      : queue_(queue), model_(model), options_(options), renderer_(queue, options.settings) {}

  Drawn draw(const RenderView& view) {
    Shot shot;
    shot.view.camera = pinhole(view.camera, options_.near);
    shot.view.camera_t2 = pinhole(view.camera_t2, options_.near);
    shot.time = view.time;
    shot.time_t2 = view.time_t2;
    shot.flow = view.time_t2 >= 0;
    shot.depth = true;
    shot.background = options_.background;
    renderer_.forward(queue_, model_, shot);
    const Images& images = renderer_.images();
    Drawn drawn;
    drawn.width = images.width;
    drawn.height = images.height;
    drawn.rgb = image_of_rgb(images.width, images.height, images.rgb.read(queue_));
    drawn.alpha = images.alpha.read(queue_);
    drawn.depth = expected_depth(images.depth.read(queue_), drawn.alpha);
    if (shot.flow)
      drawn.flow =
          flow_of_planes(images.width, images.height, images.flow.read(queue_), drawn.alpha);
    return drawn;
  }

  // Length that 1 % of the flow exceeds, in the fastest of at most eight views; at least 1 px.
  float flow_scale(const std::vector<RenderView>& views) {
    std::vector<const RenderView*> with_flow;
    for (const RenderView& view : views)
      if (view.time_t2 >= 0) with_flow.push_back(&view);
    float longest = 1;
    const size_t stride = std::max<size_t>(1, with_flow.size() / 8);
    for (size_t i = 0; i < with_flow.size(); i += stride)
      longest = std::max(longest, flow_length_above(draw(*with_flow[i]).flow, 0.01));
    return longest;
  }

 private:
  Queue& queue_;
  Model& model_;
  const RenderOptions& options_;
  Renderer renderer_;
};

void make_folder(const std::string& path) {
  std::error_code problem;
  fs::create_directories(path, problem);
  if (problem) throw Error(fmt::format("creating folder {}: {}", path, problem.message()));
}

void write_view(const std::string& folder, const std::string& name, const Drawn& drawn,
                float flow_scale) {
  const auto path = [&](const char* kind, const char* extension) {
    return fmt::format("{}/{}/{}{}", folder, kind, name, extension);
  };
  write_png(path("rgb", ".png"), drawn.rgb);
  write_png(path("alpha", ".png"), image_of_alpha(drawn.width, drawn.height, drawn.alpha));
  const DepthCounts depth = count_depth(drawn.depth);
  write_png16(path("depth", ".png"), drawn.width, drawn.height, depth.counts);
  const nlohmann::ordered_json scale{{"unit", depth.unit}, {"empty", 0}};
  write_file_atomically(path("depth", ".json"), scale.dump() + "\n");
  write_npy(path("depth", ".npy"), {{size_t(drawn.height), size_t(drawn.width)}, drawn.depth});
  if (drawn.flow.valid.empty()) return;
  write_flo(path("flow", ".flo"), drawn.flow);
  write_png(path("flow", ".png"), image_of_flow(drawn.flow, flow_scale));
}

// The scene's flow from this view to time_t2: true if known, else estimated.
FlowField reference_flow(const RenderView& view, FrameStore& frames) {
  const bool truth =
      !view.truth->flow_path.empty() && std::abs(view.truth->flow_time - view.time_t2) < 1e-6;
  if (truth) return read_true_flow(*view.truth, view.camera.width, view.camera.height).flow;
  if (!view.truth_t2) return {};
  TargetFlow target_flow =
      estimate_target_flows(*frames.rgb(*view.truth), *frames.rgb(*view.truth_t2),
                            camera_motion(*view.truth, *view.truth_t2))
          .first;
  target_flow.flow.valid = target_flow.confidence;
  return target_flow.flow;
}

// Panels that this view lacks stay black, so that all frames of a video have one layout.
Image comparison(const RenderView& view, FrameStore& frames, const Drawn& drawn, bool with_flow,
                 float flow_scale) {
  const Image black{drawn.width, drawn.height, 3,
                    std::vector<uint8_t>(3 * size_t(drawn.width) * size_t(drawn.height))};
  const Image truth = *frames.rgb(*view.truth);
  std::vector<Image> panels{truth, drawn.rgb, error_image(truth, drawn.rgb, error_gain)};
  if (with_flow) {
    FlowField reference = view.time_t2 >= 0 ? reference_flow(view, frames) : FlowField{};
    panels.push_back(drawn.flow.valid.empty() ? black : image_of_flow(drawn.flow, flow_scale));
    panels.push_back(reference.valid.empty() ? black : image_of_flow(reference, flow_scale));
  }
  return side_by_side(panels);
}

// Writes a video of each group of two or more images of one size; images are read back from files
// to save memory.
void write_movies(const std::vector<RenderView>& views, const std::string& folder,
                  const std::string& kind, const std::string& prefix, double fps, bool with_truth,
                  std::vector<std::string>& written) {
  std::vector<std::string> movies;  // in the order of the views
  for (const RenderView& view : views)
    if ((view.truth || !with_truth) &&
        std::find(movies.begin(), movies.end(), view.movie) == movies.end())
      movies.push_back(view.movie);
  for (const std::string& movie : movies) {
    std::vector<const RenderView*> parts;
    bool one_size = true;
    for (const RenderView& view : views) {
      if (view.movie != movie || (with_truth && !view.truth)) continue;
      parts.push_back(&view);
      one_size &= view.camera.width == parts[0]->camera.width &&
                  view.camera.height == parts[0]->camera.height;
    }
    if (parts.size() < 2 || !one_size) continue;
    const std::string path = fmt::format("{}/{}{}.mp4", folder, prefix, movie);
    const auto image_at = [&](size_t i) {
      return read_image(fmt::format("{}/{}/{}.png", folder, kind, parts[i]->name));
    };
    write_movie(path, parts.size(), image_at, fps);
    written.push_back(path);
  }
}

}  // namespace

void compare_views(Queue& queue, Model& model, const std::vector<RenderView>& views,
                   FrameStore& frames, const RenderOptions& options, const TakeComparedView& take) {
  Painter painter(queue, model, options);
  for (const RenderView& view : views) {
    if (!view.truth) throw Error("view " + view.name + " has no image to compare with");
    Drawn drawn = painter.draw(view);
    FlowField reference = view.time_t2 >= 0 ? reference_flow(view, frames) : FlowField{};
    take(view, {*frames.rgb(*view.truth), std::move(drawn.rgb), std::move(drawn.flow),
                std::move(reference)});
  }
}

Image comparison_image(Queue& queue, Model& model, const RenderView& view, FrameStore& frames,
                       const RenderOptions& options) {
  if (!view.truth) throw Error("view " + view.name + " has no image to compare with");
  Painter painter(queue, model, options);
  // Scale colours by the reference, so that it looks the same beside every model.
  const bool with_flow = view.time_t2 >= 0;
  const float longest = with_flow ? flow_length_above(reference_flow(view, frames), 0.002) : 0;
  return comparison(view, frames, painter.draw(view), with_flow, std::max(longest, 1.f));
}

RenderReport render_views(Queue& queue, Model& model, const std::vector<RenderView>& views,
                          FrameStore* frames, const std::string& folder,
                          const RenderOptions& options, const ProgressCallback& progress) {
  const bool compare = options.compare && frames &&
                       std::any_of(views.begin(), views.end(),
                                   [](const RenderView& view) { return view.truth != nullptr; });
  const bool with_flow = std::any_of(views.begin(), views.end(),
                                     [](const RenderView& view) { return view.time_t2 >= 0; });
  for (const char* kind : {"rgb", "alpha", "depth"}) make_folder(folder + "/" + kind);
  if (with_flow) make_folder(folder + "/flow");
  if (compare) make_folder(folder + "/compare");

  Painter painter(queue, model, options);
  const float flow_scale = painter.flow_scale(views);
  RenderReport report;
  for (const RenderView& view : views) {
    const Drawn drawn = painter.draw(view);
    write_view(folder, view.name, drawn, flow_scale);
    report.flows += !drawn.flow.valid.empty();
    if (compare && view.truth) {
      write_png(fmt::format("{}/compare/{}.png", folder, view.name),
                comparison(view, *frames, drawn, with_flow, flow_scale));
      ++report.compared;
    }
    ++report.views;
    if (progress) progress(report.views, views.size());
  }
  write_movies(views, folder, "rgb", "", options.fps, false, report.movies);
  if (compare) write_movies(views, folder, "compare", "compare_", options.fps, true, report.movies);
  return report;
}

}  // namespace gflow
