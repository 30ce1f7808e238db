// SPDX-License-Identifier: Apache-2.0
#include "apps/report/write_run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "apps/report/html.hpp"
#include "apps/report/run_report.hpp"
#include "optim/eval/rendering.hpp"
#include "optim/eval/shown_images.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/runs/run_names.hpp"
#include "optim/runs/run_state.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow::report {
namespace {

constexpr size_t kMostViews = 8;
constexpr int kWidest = 640, kWidestPart = 400;    // [px]
constexpr size_t kMostPictures = size_t{2200000};  // [bytes] of images, renders, errors, as text

SceneFacts facts_of(const LoadedScene& loaded) {
  const Scene& scene = loaded.scene;
  SceneFacts facts;
  facts.name = scene.name;
  facts.layout = scene.layout;
  facts.images = scene.train.size();
  facts.steps = scene.steps;
  std::set<int> tracks, cameras;
  for (const Frame& frame : scene.train) {
    tracks.insert(frame.track);
    cameras.insert(frame.camera);
    const Camera& camera = loaded.frames->camera(frame);
    facts.width = std::max(facts.width, camera.width);
    facts.height = std::max(facts.height, camera.height);
  }
  facts.tracks = tracks.size();
  facts.cameras = cameras.size();
  return facts;
}

// The evaluated frames by camera track. A still camera has its name, a moving one that of its first
// frame.
std::vector<CameraViews> cameras_of(const std::vector<const Frame*>& frames, const Scene& scene) {
  std::map<int, std::vector<size_t>> by_track;
  for (size_t i = 0; i < frames.size(); ++i) by_track[frames[i]->track].push_back(i);
  std::vector<CameraViews> cameras;
  for (auto& [track, views] : by_track) {
    std::stable_sort(views.begin(), views.end(),
                     [&](size_t a, size_t b) { return frames[a]->time < frames[b]->time; });
    const Frame& first = *frames[views.front()];
    const bool still = std::all_of(views.begin(), views.end(),
                                   [&](size_t i) { return frames[i]->camera == first.camera; });
    const std::string& name = scene.cameras[size_t(first.camera)].name;
    cameras.push_back({still && !name.empty() ? name : first.name, views});
  }
  return cameras;
}

// Some views, in turn from the cameras and spread over time, and the worst, in order of time.
std::vector<size_t> chosen(const std::vector<CameraViews>& cameras,
                           const std::vector<ViewMetrics>& views) {
  const size_t count = std::min(kMostViews, views.size());
  std::set<size_t> some;
  for (size_t k = 0; k < count; ++k) {
    // With more cameras than views every n-th one.
    const CameraViews& camera =
        cameras[cameras.size() > count ? k * cameras.size() / count : k % cameras.size()];
    some.insert(camera.views[(2 * k + 1) * camera.views.size() / (2 * count)]);
  }
  size_t worst = views.size();
  for (size_t i = 0; i < views.size(); ++i)
    if (std::isfinite(views[i].psnr) &&
        (worst == views.size() || views[i].psnr < views[worst].psnr))
      worst = i;
  for (size_t i = 0; some.size() < count && i < views.size(); ++i) some.insert(i);
  if (worst < views.size() && !some.count(worst)) {
    some.erase(std::prev(some.end()));
    some.insert(worst);
  }
  std::vector<size_t> list(some.begin(), some.end());
  std::stable_sort(list.begin(), list.end(),
                   [&](size_t a, size_t b) { return views[a].time < views[b].time; });
  return list;
}

// Whether some pixel has flow.
bool is_known(const FlowField& flow) {
  return std::any_of(flow.valid.begin(), flow.valid.end(), [](uint8_t v) { return v > 0; });
}

// Every n-th pixel of a flow, so that eight large ones fit into memory; its picture is smaller
// still.
FlowField coarse(const FlowField& flow) {
  const int each = (flow.width + 2 * kWidestPart - 1) / (2 * kWidestPart);
  FlowField small = zero_flow((flow.width + each - 1) / each, (flow.height + each - 1) / each);
  for (int y = 0, i = 0; y < small.height; ++y)
    for (int x = 0; x < small.width; ++x, ++i) {
      const size_t from = size_t(y * each) * size_t(flow.width) + size_t(x * each);
      small.valid[size_t(i)] = flow.valid[from];
      for (size_t k = 0; k < 2; ++k) small.uv[2 * size_t(i) + k] = flow.uv[2 * from + k];
    }
  return small;
}

// Renders the chosen views and draws them: first all, because their flow shares one scale.
void draw_views(Queue& queue, const RunFolder& run, const RunState& state,
                const LoadedScene& loaded, const std::vector<const Frame*>& frames,
                RunReport& report) {
  const std::vector<size_t> some = chosen(report.cameras, report.evaluation.views);
  // Of all frames, so that flow leads to the next time step.
  const std::vector<RenderView> all =
      split_views(loaded.scene, frames_of_split(loaded.scene, report.split),
                  loaded.frames->cameras(), report.split);
  std::vector<RenderView> views;
  for (const size_t i : some)
    for (const RenderView& view : all)
      if (view.name == frames[i]->name) views.push_back(view);
  RenderOptions options;
  options.settings = engine_settings(state.config);
  options.near = near_or_default(state.config.render.near, loaded.scene);
  if (state.config.scene.background == Background::black) options.background = {0, 0, 0};
  Model model(queue, state.model, Purpose::rendering);
  std::vector<std::pair<FlowField, FlowField>> flows;
  size_t bytes = 0, next = 0;
  compare_views(
      queue, model, views, *loaded.frames, options,
      [&](const RenderView& view, ComparedView&& compared) {
        const ViewMetrics& metrics = report.evaluation.views[some[next++]];
        // The image that the metrics are of, where evaluation has kept it.
        const std::string kept = run.path("test/" + view.name + ".png");
        if (report.split == "test" && std::filesystem::exists(kept))
          if (Image image = over_background(read_image(kept), {255, 255, 255});
              image.width == compared.truth.width && image.height == compared.truth.height)
            compared.rendered = std::move(image);
        ShownView shown;
        shown.metrics = metrics;
        shown.truth = picture_of(compared.truth, kWidest);
        shown.rendered = picture_of(compared.rendered, kWidest);
        shown.error = picture_of(error_image(compared.truth, compared.rendered, 4), kWidestPart);
        bytes +=
            shown.truth.address.size() + shown.rendered.address.size() + shown.error.address.size();
        if (bytes > kMostPictures) return;
        flows.emplace_back();
        if (is_known(compared.flow)) flows.back().first = coarse(compared.flow);
        if (is_known(compared.reference)) flows.back().second = coarse(compared.reference);
        report.views.push_back(std::move(shown));
      });
  // Scaled by the target flow, which does not depend on the model.
  double of_model = 1, of_target = 0;
  for (const auto& [flow, target] : flows) {
    of_model = std::max(of_model, double(flow_length_above(flow, 0.01)));
    of_target = std::max(of_target, double(flow_length_above(target, 0.01)));
  }
  report.flow_length = of_target > 0 ? std::max(of_target, 1.0) : of_model;
  const auto drawn = [&](const FlowField& flow) {
    return is_known(flow) ? picture_of(image_of_flow(flow, float(report.flow_length)), kWidestPart)
                          : Picture{};
  };
  for (size_t i = 0; i < flows.size(); ++i) {
    report.views[i].flow = drawn(flows[i].first);
    report.views[i].target = drawn(flows[i].second);
  }
}

// Name of the folder, also of "." and of a path with a slash at its end.
std::string name_of_folder(const std::string& path) {
  std::error_code none;
  const std::filesystem::path full = std::filesystem::weakly_canonical(path, none);
  return full.filename().string();
}

// "driver 3.1, OpenCL 3.0", if the training's device is this one.
std::string driver_of(const DeviceInfo& device, const RunFacts& facts) {
  if (facts.device != device.full_name()) return "";
  return fmt::format("{}, {}", device.driver, device.version);
}

RunReport gathered(Queue& queue, const RunFolder& run, const Evaluation& evaluation,
                   const std::string& split, const std::string& version,
                   const std::vector<std::string>& notices) {
  const WarningsTo nowhere([](const std::string&) {});  // they were printed before
  const RunState state = read_run_state(run);
  const LoadedScene loaded =
      load_scene(state.config.scene, run.path("frames"), state.model.shape.origin);
  if (refines_cameras(state.config.cameras, loaded.scene)) run.move_cameras(*loaded.frames);
  RunReport report;
  report.run = name_of_folder(run.folder());
  report.date = today();
  report.version = version;
  report.split = split;
  report.scene = facts_of(loaded);
  // A folder called scene says nothing; that of a video whose cameras were found is in the run.
  report.title = report.scene.name == kRunScene ? report.run : report.scene.name;
  report.config = state.config;
  report.facts = state.facts;
  report.driver = driver_of(queue.info, state.facts);
  report.evaluation = evaluation;
  report.log = read_log(run.folder());
  report.notices = notices;
  for (const std::string& notice : loaded.scene.notices)
    if (std::find(notices.begin(), notices.end(), notice) == notices.end())
      report.notices.push_back(notice);
  std::map<std::string, const Frame*> named;
  for (const Frame& frame : frames_of_split(loaded.scene, split)) named[frame.name] = &frame;
  std::vector<const Frame*> frames;
  for (const ViewMetrics& view : evaluation.views) frames.push_back(named.at(view.name));
  report.cameras = cameras_of(frames, loaded.scene);
  if (!frames.empty()) draw_views(queue, run, state, loaded, frames, report);
  return report;
}

}  // namespace

std::string write_run_report(Queue& queue, const RunFolder& run, const Evaluation& evaluation,
                             const std::string& split, const std::string& version,
                             const std::vector<std::string>& notices) {
  const std::string path = run.path(kRunReport);
  try {
    write_file_atomically(
        path, run_report_html(gathered(queue, run, evaluation, split, version, notices)));
    return path;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& problem) {
    warn(fmt::format("{} not written: {}; the run itself is complete", path, problem.what()));
    return "";
  }
}

}  // namespace gflow::report
