// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/evaluation.hpp"

#include <cmath>
#include <set>
#include <utility>

#include "optim/eval/camera_fit.hpp"
#include "optim/eval/metric_networks.hpp"
#include "optim/eval/shown_images.hpp"
#include "optim/flow/estimated_flow.hpp"
#include "optim/loss/metrics.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/depths.hpp"
#include "runtime/base/warning.hpp"
#include "shared/loss.h"

namespace gflow {
namespace {

constexpr double kMoving = 1;  // [px] pixels with longer reference flow count as moving
constexpr size_t kMostWithDis = 30;

// Reference flow of a view: planes [2, H, W], and masks of where it is known, where it moves, and
// what is visible at both times.
struct Reference {
  std::vector<float> planes;
  std::vector<uint8_t> known, moving, seen;
  double time = 0;              // target time [0, 1]
  const Frame* next = nullptr;  // target frame; null if it is not evaluated
  bool true_flow = false;       // true flow, as from a static camera

  bool empty() const { return planes.empty(); }
  // Where counted is 0, nothing is known.
  void leave_out(const std::vector<uint8_t>& counted) {
    for (std::vector<uint8_t>* mask : {&known, &moving, &seen})
      for (size_t i = 0; i < mask->size(); ++i)
        if (!counted[i]) (*mask)[i] = 0;
  }
};

std::vector<float> planes_of(const FlowField& flow) {
  const size_t pixels = flow.uv.size() / 2;
  std::vector<float> planes(flow.uv.size());
  for (size_t i = 0; i < pixels; ++i) {
    planes[i] = flow.uv[2 * i];
    planes[pixels + i] = flow.uv[2 * i + 1];
  }
  return planes;
}

Reference reference_of(const TargetFlow& target_flow, bool truth) {
  Reference r;
  r.true_flow = truth;
  r.planes = planes_of(target_flow.flow);
  r.known = truth ? target_flow.flow.valid : target_flow.confidence;
  r.seen = target_flow.confidence;
  const size_t pixels = r.known.size();
  r.moving.resize(pixels);
  // The same limit as in training.
  const auto too_large = [](float x) { return std::fabs(x) > TARGET_FLOW_LIMIT; };
  for (size_t i = 0; i < pixels; ++i) {
    if (too_large(r.planes[i]) || too_large(r.planes[pixels + i])) r.known[i] = 0;
    r.moving[i] = r.known[i] && std::hypot(r.planes[i], r.planes[pixels + i]) > kMoving;
  }
  return r;
}

// For each frame the next one of its camera track among `frames`, at most max_gap steps away, or
// null.
std::vector<const Frame*> followers(const std::vector<Frame>& frames, int max_gap) {
  std::vector<const Frame*> next(frames.size(), nullptr);
  for (size_t i = 0; i < frames.size(); ++i)
    for (const Frame& other : frames)
      if (other.track == frames[i].track && other.time > frames[i].time &&
          other.step - frames[i].step <= max_gap && (!next[i] || other.time < next[i]->time))
        next[i] = &other;
  return next;
}

double mean_of(const std::vector<ViewMetrics>& views, double ViewMetrics::*metric) {
  double sum = 0;
  size_t count = 0;
  for (const ViewMetrics& view : views)
    if (std::isfinite(view.*metric)) {
      sum += view.*metric;
      ++count;
    }
  return count ? sum / double(count) : kNotMeasured;
}

// Whether any pixel is selected. Without one a metric is undefined; the metric functions take an
// empty mask as all pixels.
bool any(const std::vector<uint8_t>& mask) {
  for (const uint8_t m : mask)
    if (m) return true;
  return false;
}

// Evaluates the views in their order.
class Evaluator {
 public:
  Evaluator(Queue& queue, Model& model, const TrainOptions& config, const LoadedScene& loaded,
            const std::vector<Frame>& frames, const std::string& folder,
            const std::string& flow_folder)
      : queue_(queue),
        model_(model),
        config_(config),
        scene_(loaded.scene),
        frames_(frames),
        folder_(folder),
        store_(*loaded.frames),
        dis_(loaded.scene, store_, flow_folder, warn),
        networks_(config.metrics),
        renderer_(queue, engine_settings(config)),
        next_(followers(frames, config.flow.max_gap)),
        near_(near_or_default(config.render.near, loaded.scene)),
        stride_((frames.size() + kMostWithDis - 1) / kMostWithDis) {
    result_.flow_reference = "none";
    result_.trained_on = are_training_images(loaded.scene, frames);
    result_.lpips_model = config.metrics.lpips;
    result_.clip_model = config.metrics.clip;
  }

  // Fits the cameras to their images, each to its first one here. Before all add().
  void fit_cameras() {
    std::set<int> fitted;
    unfitted_.assign(frames_.size(), kNotMeasured);
    for (size_t i = 0; i < frames_.size(); ++i) {
      const Frame& frame = frames_[i];
      if (!fitted.insert(frame.camera).second) continue;
      const Camera camera = store_.camera(frame);
      const auto truth = store_.rgb(frame);
      const auto counted = store_.counted(frame);
      const Shot shot = shot_of(frame, camera, {});
      renderer_.forward(queue_, model_, shot);
      unfitted_[i] = psnr(PlanarImage::from_planes(camera.width, camera.height,
                                                   renderer_.images().rgb.read(queue_)),
                          PlanarImage::from_bytes(camera.width, camera.height, truth->pixels),
                          counted ? counted->pixels : std::vector<uint8_t>{});
      const double focal =
          camera.fx / reduced(scene_.cameras[size_t(frame.camera)], config_.scene.resolution).fx;
      store_.move_camera(size_t(frame.camera),
                         fitted_pose(queue_, model_, renderer_, shot, camera,
                                     depth_of_scene(scene_, frame.camera), *truth, counted.get()),
                         focal);
    }
    result_.fitted_cameras = true;
  }

  void add(size_t i) {
    const Frame& frame = frames_[i];
    const Camera& camera = store_.camera(frame);
    Reference reference = reference_of_view(i);
    renderer_.forward(queue_, model_, shot_of(frame, camera, reference));
    const PlanarImage truth =
        PlanarImage::from_bytes(camera.width, camera.height, store_.rgb(frame)->pixels);
    const std::vector<float> planes = renderer_.images().rgb.read(queue_);
    PlanarImage image = PlanarImage::from_planes(camera.width, camera.height, planes);
    if (!folder_.empty())
      write_png(folder_ + "/" + frame.name + ".png",
                image_of_rgb(camera.width, camera.height, planes));

    // Where pixels do not count, the truth replaces the image; means are over the others.
    const auto counted = store_.counted(frame);
    if (counted) {
      const size_t pixels = counted->pixels.size();
      for (size_t k = 0; k < image.values.size(); ++k)
        if (!counted->pixels[k % pixels]) image.values[k] = truth.values[k];
      reference.leave_out(counted->pixels);
    }
    ViewMetrics view;
    view.name = frame.name;
    view.step = frame.step;
    view.time = frame.time;
    if (!unfitted_.empty()) view.psnr_unfitted = unfitted_[i];
    evaluate_image(view, image, truth, reference,
                   counted ? counted->pixels : std::vector<uint8_t>{});
    evaluate_flow(view, reference, i);
    if (has_true_depth(frame, config_.scene)) {
      std::vector<float> depth = read_depth_map(frame, scene_.cameras[size_t(frame.camera)],
                                                camera.width, camera.height, config_.scene);
      for (size_t k = 0; counted && k < depth.size(); ++k)
        if (!counted->pixels[k]) depth[k] = NAN;  // unknown
      view.depth_error = depth_error(renderer_.images().depth.read(queue_),
                                     renderer_.images().alpha.read(queue_), depth);
    }
    networks_.evaluate(view, image, truth);
    result_.views.push_back(view);
    evaluate_flicker(frame, image, truth, std::move(reference));
  }

  Evaluation result() {
    for (const auto& [name, metric] : view_metrics())
      result_.mean.*metric = mean_of(result_.views, metric);
    return result_;
  }

 private:
  // What flicker of a view needs when the next one is rendered.
  struct Before {
    Reference reference;
    std::vector<float> error;
    int width = 0, height = 0;
  };

  // DIS is fast for cameras that stand still.
  bool with_dis(size_t i) const {
    const bool fast = next_[i] && camera_motion(frames_[i], *next_[i]) == CameraMotion::none;
    return i % stride_ == 0 && (config_.flow.enabled || fast);
  }

  Reference reference_of_view(size_t i) {
    const Frame& frame = frames_[i];
    if (!frame.flow_path.empty()) {
      const Camera& camera = store_.camera(frame);
      Reference reference = reference_of(read_true_flow(frame, camera.width, camera.height), true);
      reference.time = frame.flow_time;
      if (next_[i] && next_[i]->camera == frame.camera &&
          std::abs(next_[i]->time - frame.flow_time) < 1e-6)
        reference.next = next_[i];
      result_.flow_reference = "true";
      return reference;
    }
    if (!next_[i] || !with_dis(i)) return {};
    Reference reference = reference_of(dis_.target_flow(frame, *next_[i]), false);
    reference.time = next_[i]->time;
    reference.next = next_[i];
    if (result_.flow_reference == "none") result_.flow_reference = "dis";
    return reference;
  }

  Shot shot_of(const Frame& frame, const Camera& camera, const Reference& reference) const {
    const bool moves = reference.next && !reference.true_flow;  // the camera may have moved
    const float level = float(shown_level(config_.scene.background)) / 255;
    Shot shot;
    shot.view.camera = pinhole(camera, near_);
    shot.view.camera_t2 = pinhole(store_.camera(moves ? *reference.next : frame), near_);
    shot.time = frame.time;
    shot.time_t2 = reference.time;
    shot.flow = !reference.empty();
    shot.depth = has_true_depth(frame, config_.scene);
    shot.background = {level, level, level};
    return shot;
  }

  static void evaluate_image(ViewMetrics& view, const PlanarImage& image, const PlanarImage& truth,
                             const Reference& reference, const std::vector<uint8_t>& counted) {
    if (!counted.empty() && !any(counted)) return;
    const std::vector<double> similarity = ssim_map(image, truth);
    view.psnr = psnr(image, truth, counted);
    view.psnr_matched = psnr(color_matched(image, truth, counted), truth, counted);
    view.ssim = mean_of_map(similarity, counted);
    if (!any(reference.moving)) return;
    view.psnr_dynamic = psnr(image, truth, reference.moving);
    view.ssim_dynamic = mean_of_map(similarity, reference.moving);
  }

  void evaluate_flow(ViewMetrics& view, const Reference& reference, size_t i) {
    if (!any(reference.known)) return;
    const std::vector<float> flow = renderer_.images().flow.read(queue_);
    const FlowMetrics known = flow_metrics(flow, reference.planes, reference.known);
    view.flow_epe = known.epe;
    view.fl_all = known.fl_all;
    if (!any(reference.moving)) return;
    view.flow_epe_dynamic = flow_metrics(flow, reference.planes, reference.moving).epe;
    if (reference.true_flow && with_dis(i) && next_[i] && next_[i]->camera == frames_[i].camera)
      view.teacher_epe_dynamic =
          flow_metrics(planes_of(dis_.target_flow(frames_[i], *next_[i]).flow), reference.planes,
                       reference.moving)
              .epe;
  }

  // Sets the flicker of the previous view, now that its next one is rendered.
  void evaluate_flicker(const Frame& frame, const PlanarImage& image, const PlanarImage& truth,
                        Reference&& reference) {
    const bool follows = before_ && before_->reference.next == &frame &&
                         before_->width == truth.width && before_->height == truth.height;
    if (!follows && !reference.next) return before_.reset();
    std::vector<float> error = difference(image, truth);
    if (follows && any(before_->reference.seen))
      result_.views[result_.views.size() - 2].flicker =
          flicker(before_->error, error, truth.width, truth.height, before_->reference.planes,
                  before_->reference.seen);
    before_ = Before{std::move(reference), std::move(error), truth.width, truth.height};
  }

  Queue& queue_;
  Model& model_;
  const TrainOptions& config_;
  const Scene& scene_;
  const std::vector<Frame>& frames_;
  const std::string& folder_;
  FrameStore& store_;
  const FlowBetween dis_;
  MetricNetworks networks_;
  Renderer renderer_;
  const std::vector<const Frame*> next_;
  const float near_;
  const size_t stride_;  // every stride_-th view uses DIS
  std::optional<Before> before_;
  std::vector<double> unfitted_;  // PSNR of each view before its camera was fitted; empty: none was
  Evaluation result_;
};

}  // namespace

const std::vector<NamedMetric>& view_metrics() {
  static const std::vector<NamedMetric> metrics{
      {"psnr", &ViewMetrics::psnr},
      {"psnr_matched", &ViewMetrics::psnr_matched},
      {"psnr_unfitted", &ViewMetrics::psnr_unfitted},
      {"ssim", &ViewMetrics::ssim},
      {"psnr_dynamic", &ViewMetrics::psnr_dynamic},
      {"ssim_dynamic", &ViewMetrics::ssim_dynamic},
      {"flow_epe", &ViewMetrics::flow_epe},
      {"flow_epe_dynamic", &ViewMetrics::flow_epe_dynamic},
      {"fl_all", &ViewMetrics::fl_all},
      {"teacher_epe_dynamic", &ViewMetrics::teacher_epe_dynamic},
      {"depth_error", &ViewMetrics::depth_error},
      {"flicker", &ViewMetrics::flicker},
      {"lpips", &ViewMetrics::lpips},
      {"clip", &ViewMetrics::clip}};
  return metrics;
}

Evaluation evaluate(Queue& queue, Model& model, const TrainOptions& config,
                    const LoadedScene& loaded, const std::vector<Frame>& frames,
                    const ProgressCallback& progress, const std::string& folder,
                    const std::string& flow_folder) {
  Evaluator evaluator(queue, model, config, loaded, frames, folder, flow_folder);
  if (refines_cameras(config.cameras, loaded.scene) && !are_training_images(loaded.scene, frames))
    evaluator.fit_cameras();
  for (size_t i = 0; i < frames.size(); ++i) {
    evaluator.add(i);
    if (progress) progress(i + 1, frames.size());
  }
  Evaluation evaluation = evaluator.result();
  evaluation.gaussians = model.parameters.count;
  return evaluation;
}

std::vector<Frame> sample_of(const std::vector<Frame>& frames, size_t most) {
  std::vector<Frame> sample;
  const size_t count = std::min(most, frames.size());
  for (size_t i = 0; i < count; ++i)
    sample.push_back(frames[(2 * i + 1) * frames.size() / (2 * count)]);
  return sample;
}

}  // namespace gflow
