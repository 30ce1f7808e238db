// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/guidance_objective.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "optim/engine/random_streams.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

// Whether the scene or the settings give cameras. Otherwise the layout defines them: z is up, and
// they look at the origin.
bool has_own_cameras(const Scene& scene, const SceneOptions& config) {
  return !takes_cameras(scene.layout) || !config.cameras.empty();
}

Eigen::Vector3d up_of(const Scene& scene, const TrainOptions& config) {
  const UpAxis axis = config.guidance.up;
  const bool z = is_z_up(scene.layout) || !has_own_cameras(scene, config.scene);
  if (axis == UpAxis::x) return Eigen::Vector3d::UnitX();
  if (axis == UpAxis::y) return Eigen::Vector3d::UnitY();
  if (axis == UpAxis::z || (axis == UpAxis::automatic && z)) return Eigen::Vector3d::UnitZ();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train)
    sum -= scene.cameras[size_t(frame.camera)].viewmat.block<1, 3>(1, 0).transpose();
  return sum.norm() > 1e-6 ? sum.normalized() : Eigen::Vector3d::UnitZ();
}

Orbit orbit_of(const Scene& scene, const TrainOptions& config) {
  Orbit orbit;
  if (has_own_cameras(scene, config.scene)) orbit.focus = focus_point(scene);
  orbit.up = up_of(scene, config);
  return orbit;
}

const char* split_name(GuidanceCameras cameras) {
  return cameras == GuidanceCameras::test ? "test" : "val";
}

// Bytes [H, W, 3] as planes [3, H, W] in [0, 1].
std::vector<float> planes_of(const Image& image) {
  const size_t pixels = image.pixels.size() / 3;
  std::vector<float> planes(3 * pixels);
  for (size_t i = 0; i < pixels; ++i)
    for (size_t c = 0; c < 3; ++c) planes[c * pixels + i] = float(image.pixels[3 * i + c]) / 255;
  return planes;
}

}  // namespace

GuidanceObjective::GuidanceObjective(Queue& queue, const TrainOptions& config, const Scene& scene,
                                     FrameStore& frames, Guidance& guidance)
    : config_(config),
      scene_(scene),
      frames_(frames),
      guidance_(guidance),
      orbit_(orbit_of(scene, config)),
      flow_loss_(queue, config.flow.robust_px) {
  std::set<double> times;
  for (const Frame& frame : scene.train) times.insert(frame.time);
  times_.assign(times.begin(), times.end());
  if (config.guidance.cameras != GuidanceCameras::orbit)
    frames_of_split(scene, split_name(config.guidance.cameras));  // throws if there are none
}

bool GuidanceObjective::is_due(int step) const {
  const GuidanceOptions& g = config_.guidance;
  return step >= g.start && (g.stop == 0 || step < g.stop) && (step - g.start) % g.every == 0;
}

Camera GuidanceObjective::camera_for(int step, int view, const Frame& frame) const {
  const GuidanceOptions& g = config_.guidance;
  const uint seed = uint(config_.train.seed), index = uint(step * g.views + view);
  if (g.cameras == GuidanceCameras::orbit) {
    const auto drawn = [&](uint stream, float most) {
      return (2 * double(random_uniform(seed, stream, index)) - 1) * double(most);
    };
    Camera camera = moved(orbit_, frames_.camera(frame), drawn(streams::kAzimuth, g.azimuth),
                          drawn(streams::kElevation, g.elevation));
    camera.name.clear();
    return camera;
  }
  // One of the frames nearest in time.
  std::vector<const Frame*> nearest;
  double least = std::numeric_limits<double>::max();
  for (const Frame& other : frames_of_split(scene_, split_name(g.cameras))) {
    const double away = std::fabs(other.time - frame.time);
    if (away < least - 1e-9) nearest.clear();
    least = std::min(least, away);
    if (away <= least + 1e-9) nearest.push_back(&other);
  }
  return frames_.camera(
      *nearest[random_bits(seed, streams::kGuidanceCamera, index) % nearest.size()]);
}

GuidanceRequest GuidanceObjective::request_for(const StepContext& context) const {
  const int step = context.step;
  const GuidanceOptions& g = config_.guidance;
  const Frame& frame = *context.frame;
  const int end =
      g.stop == 0 ? config_.train.iterations : std::min(g.stop, config_.train.iterations);
  GuidanceRequest request;
  request.step = step;
  request.steps = config_.train.iterations;
  request.progress = double(step - g.start) / std::max(end - 1 - g.start, 1);
  request.seed = random_bits(uint(config_.train.seed), streams::kGuidance, uint(step));
  request.time = frame.time;
  request.frame = config_.scene.first_step + config_.scene.stride * frame.step;
  const auto next = std::upper_bound(times_.begin(), times_.end(), frame.time + 1e-9);
  request.wants_flow = g.flow > 0 && next != times_.end();
  if (request.wants_flow) request.next_time = *next;
  request.next_frame = request.frame + config_.scene.stride;
  for (size_t c = 0; c < 3; ++c) request.background[c] = float(context.background[c]) / 255;
  request.reference.camera = frames_.camera(frame);
  request.reference.rgb = planes_of(frames_.rgb_over(frame, context.background));
  const OrbitPosition from = place_of(orbit_, request.reference.camera);
  for (int v = 0; v < g.views; ++v) {
    GuidanceView view;
    view.camera = squared(camera_for(step, v, frame), g.size);
    const OrbitPosition away = difference(from, place_of(orbit_, view.camera));
    view.azimuth = away.azimuth;
    view.elevation = away.elevation;
    view.distance = away.distance;
    request.views.push_back(std::move(view));
  }
  return request;
}

Shot GuidanceObjective::shot_of(const GuidanceRequest& request, const GuidanceView& view,
                                int sh_degree) const {
  Shot shot;
  shot.view.camera = shot.view.camera_t2 =
      pinhole(view.camera, near_or_default(config_.render.near, scene_));
  shot.time = request.time;
  shot.time_t2 = request.next_time;
  shot.flow = request.wants_flow;
  shot.sh_degree = sh_degree;
  shot.background = request.background;
  return shot;
}

void GuidanceObjective::add_novel_views(NovelViews& views, const StepContext& context) {
  if (!is_due(context.step)) return;
  auto& [queue, model, renderer, after_backward] = views;
  GuidanceRequest request = request_for(context);
  for (GuidanceView& view : request.views) {
    renderer.forward(queue, model, shot_of(request, view, context.sh_degree));
    view.rgb = renderer.images().rgb.read(queue);
    if (request.wants_flow) view.flow = renderer.images().flow.read(queue);
  }
  const std::vector<GuidanceAnswer> answers = guidance_.guide(request);
  require_usable(request, answers, guidance_.name());

  strength_ = 0;
  had_flow_ = false;
  // In reverse order, because the last view is still rendered.
  for (size_t i = answers.size(); i-- > 0;) {
    if (answers[i].gradient.empty() && answers[i].flow.empty()) continue;
    const Shot shot = shot_of(request, request.views[i], context.sh_degree);
    if (i + 1 < answers.size()) renderer.forward(queue, model, shot);
    set_gradients(queue, renderer.images(), answers[i]);
    renderer.backward(queue, model, v_);
    after_backward(shot);
  }
}

void GuidanceObjective::set_gradients(Queue& queue, const Images& images,
                                      const GuidanceAnswer& answer) {
  const GuidanceOptions& g = config_.guidance;
  const size_t pixels = size_t(images.width) * size_t(images.height);
  const double values = 3 * double(pixels);
  std::vector<float> v_rgb(3 * pixels, 0.f);
  if (!answer.gradient.empty()) {
    const float factor = float(double(g.weight) * double(answer.weight) / (values * g.views));
    double sum = 0;
    for (size_t i = 0; i < v_rgb.size(); ++i) {
      v_rgb[i] = factor * answer.gradient[i];
      sum += std::fabs(double(answer.gradient[i]));
    }
    strength_ += double(answer.weight) * sum / (values * g.views);
  }
  v_.v_rgb.ensure(queue, v_rgb.size());
  v_.v_rgb.write(queue, v_rgb);
  v_.v_alpha.ensure(queue, pixels);
  v_.v_alpha.fill(queue, 0.f);
  v_.v_flow.ensure(queue, 2 * pixels);
  if (answer.flow.empty()) {
    v_.v_flow.fill(queue, 0.f);
    return;
  }
  std::vector<cl_uchar> confidence(answer.confidence.begin(), answer.confidence.end());
  if (confidence.empty()) confidence.assign(pixels, 255);
  target_flow_.ensure(queue, 2 * pixels);
  target_flow_.write(queue, answer.flow);
  confidence_.ensure(queue, pixels);
  confidence_.write(queue, confidence);
  flow_loss_.run(queue, g.flow * answer.flow_weight / float(g.views), images.width, images.height,
                 images.flow, images.alpha, target_flow_, confidence_, v_.v_flow);
  had_flow_ = true;
}

void GuidanceObjective::report(Queue& queue, const Renderer&, LossReport& report) {
  const double epe = had_flow_ ? flow_loss_.value(queue).epe : std::nan("");
  report.terms.push_back(
      {"guidance", strength_,
       std::isfinite(strength_) ? fmt::format("guidance {:.4f}", strength_) : ""});
  report.terms.push_back({"guidance_flow_epe", epe, ""});
}

}  // namespace gflow
