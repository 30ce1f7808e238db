// SPDX-License-Identifier: Apache-2.0
#include "optim/train/population.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "optim/density/memory.hpp"
#include "optim/engine/random_streams.hpp"
#include "optim/options/scene_defaults.hpp"
#include "optim/scene/depths.hpp"
#include "optim/train/curriculum.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr int kRoundsToRearrange = 5;  // rounds from one Motion::rearrange() to the next
constexpr size_t kWeighedViews = 200;  // largest number in which hidden Gaussians are sought
constexpr int kComparedTimes = 60;     // largest number of times at which a round compares poses

// nullptr if the split is off, Gaussians have no motion of their own, or keys are trained one by
// one: then later motion is unknown.
std::unique_ptr<StaticDetection> static_detection_for(Queue& queue, const TrainOptions& config,
                                                      const Scene& scene,
                                                      const Parameters& parameters) {
  if (config.motion.static_threshold == 0 || scene.steps < 2 || config.train.sequential)
    return nullptr;
  return parameters.has_motion_rows() ? std::make_unique<StaticDetection>(queue) : nullptr;
}

DensityRule density_rule(const TrainOptions& config, const Scene& scene, const MotionShape& shape) {
  const DensityOptions options = with_scene_defaults(config, scene).density;
  const float extent = float(scene.extent);
  DensityRule rule;
  static_cast<DensityOptions&>(rule) = options;
  if (is_permanent(shape.motion)) rule.grad_threshold = config.motion.hexplane.grad_threshold;
  rule.prune_scale *= float(size_of_scene(scene));
  rule.noise /= extent * extent;  // the rate is in scene units, the covariance in their square
  rule.scale_weight /= extent;
  rule.cutoff = shape.cutoff;
  rule.split.split_scale = options.split_scale * extent;
  rule.split.split_travel = options.split_travel;
  rule.split.duration = shape.duration;
  rule.split.min_lifetime = options.min_lifetime * shape.duration / float(std::max(scene.steps, 1));
  return rule;
}

}  // namespace

Population::Population(Queue& queue, const TrainOptions& config, const Scene& scene, Model& model)
    : config_(config),
      scene_(scene),
      model_(model),
      density_(config.density.enabled ? make_density(queue, config.density.strategy) : nullptr),
      density_rule_(density_rule(config, scene, model.shape)),
      near_fade_(queue),
      hidden_(queue),
      order_(queue),
      static_detection_(static_detection_for(queue, config, scene, model.parameters)) {
  density_rule_.wakes = static_detection_ != nullptr;
}

void Population::see(Queue& queue, const Renderer& renderer, const Shot& shot, int width,
                     int height, bool some_ignored) {
  const Buffer<cl_uint>& tiles_touched = renderer.engine().splats().tiles_touched;
  if (density_)
    density_->see(queue, model_.parameters,
                  {width, height, renderer.rows().list(), tiles_touched,
                   renderer.gradients().v_means2d, some_ignored});
  if (!static_detection_) return;
  const float t2 = model_.time(shot.time_t2);
  const GaussianGradients& g = renderer.gradients();
  static_detection_->see(queue, model_.parameters, renderer.rows(), tiles_touched,
                         model_.time(shot.time), g.v_means, shot.flow ? &t2 : nullptr, g.v_means_t2,
                         renderer.stood_still());
}

void Population::add_gradients(Queue& queue) {
  if (density_) density_->add_gradients(queue, model_.parameters, density_rule_);
}

bool Population::after_step(Queue& queue, const Renderer& renderer, const Stage& now, int step,
                            float position_rate) {
  const uint32_t seed = uint32_t(config_.train.seed);
  const int done = step + 1;
  const bool controlled = density_ && now.fits();
  if (controlled)
    density_->after_step(
        queue, model_.parameters, renderer.gaussians(), density_rule_,
        {done, refining(done), position_rate, random_bits(seed, streams::kNoise, uint32_t(step))});
  bool others = settling(done) && settle(queue);
  if (controlled && refining(done) && done % config_.density.every == 0) {
    others |= refine(queue, random_bits(seed, streams::kSplit, uint32_t(step)));
    others |= put_in_order(queue);
    if (done % (kRoundsToRearrange * config_.density.every) == 0)
      model_.motion->rearrange(queue, model_.parameters);
  }
  return others;
}

bool Population::refining(int done) const {
  const DensityOptions& d = config_.density;
  return done >= d.start && done <= d.stop_fraction * float(config_.train.iterations);
}

void Population::fade_near(Queue& queue, uint32_t random) {
  const Frame& one = scene_.train[random % scene_.train.size()];
  std::map<int, PinholeCamera> cameras;
  for (const Frame& frame : scene_.train)
    if (frame.step == one.step)
      cameras.emplace(frame.camera, pinhole(scene_.cameras[size_t(frame.camera)],
                                            near_or_default(config_.render.near, scene_)));
  std::vector<PinholeCamera> views;
  for (const auto& [camera, view] : cameras) views.push_back(view);
  near_fade_.run(queue, model_.parameters, *model_.motion, model_.time(one.time), views,
                 logit(density_rule_.prune_opacity) - 1);
}

// In the first round after the curriculum, when all views have been trained, and in the last one.
bool Population::seeks_hidden(int done) const {
  const DensityOptions& d = config_.density;
  const bool permanent = is_permanent(model_.shape.motion);
  if (!density_ || !permanent || d.prune_hidden == 0 || done % d.every != 0 || !refining(done))
    return false;
  const Curriculum curriculum = Curriculum::of(config_, permanent);
  const auto all_trained = [&](int at) {
    return refining(at) && !curriculum.warming(at) && curriculum.share(at) >= 1;
  };
  return all_trained(done) && (!all_trained(done - d.every) || !refining(done + d.every));
}

bool Population::fade_hidden(Queue& queue, int step, const Renderer& renderer,
                             const std::function<void(const Frame&)>& weigh) {
  if (!seeks_hidden(step + 1)) return false;
  Parameters& p = model_.parameters;
  const std::vector<Frame>& frames = scene_.train;
  const uint seed = uint(config_.train.seed);
  const bool all = frames.size() <= kWeighedViews;
  try {
    hidden_.begin(queue, p, all);
    for (size_t k = 0; k < std::min(frames.size(), kWeighedViews); ++k) {
      const uint any = random_bits(seed, streams::kWeighed, uint(k));
      weigh(frames[all ? k : any % frames.size()]);
      hidden_.see(queue, p, renderer.rows().list(), renderer.shot().view.camera,
                  renderer.engine().splats(), renderer.gradients());
    }
  } catch (const Error& problem) {
    if (!is_out_of_memory(problem)) throw;
    memory_is_short(problem.what());
    return false;
  }
  hidden_.fade(queue, p, config_.density.prune_hidden, logit(density_rule_.prune_opacity) - 1);
  return true;
}

bool Population::refine(Queue& queue, uint32_t seed) {
  Parameters& p = model_.parameters;
  DensityRule rule = density_rule_;
  const size_t budget = size_t(config_.density.memory);
  memory_holds_ =
      std::min(memory_holds_, most_gaussians(queue.info, p, budget, config_.adam.beta1 > 0));
  rule.cap = int(std::min(size_t(rule.cap), memory_holds_));
  try {
    fade_near(queue, seed);
    density_->refine(queue, p, *model_.motion, rule, seed);
  } catch (const Error& problem) {
    if (!is_out_of_memory(problem)) throw;
    memory_holds_ = p.count;  // do not try to grow again
    memory_is_short(problem.what());
    return false;
  }
  if (static_detection_) static_detection_->forget();
  if (rule.cap < density_rule_.cap && p.count >= size_t(rule.cap))
    memory_is_short(
        fmt::format("density.memory = {} MiB{} fits {} Gaussians, fewer than density.cap",
                    budget ? budget : size_t(queue.info.global_memory / 4 * 3 >> 20),
                    budget ? "" : " (three quarters of the device memory)", memory_holds_));
  return true;
}

void Population::memory_is_short(const std::string& sentence) {
  if (memory_was_short_) return;
  memory_was_short_ = true;
  notice_ = fmt::format("memory limit reached, training continues with {} Gaussians: {}",
                        model_.parameters.count, sentence);
}

// Not after the last step: a Gaussian that becomes static changes a little, and no step would
// correct it.
bool Population::settling(int done) const {
  return static_detection_ && done % config_.motion.static_every == 0 &&
         done < config_.train.iterations;
}

bool Population::settle(Queue& queue) {
  StaticRule rule;
  rule.most = config_.motion.static_threshold;
  rule.wake = config_.motion.wake_threshold;
  rule.duration = model_.shape.duration;
  rule.moments = std::clamp(scene_.steps, 2, kComparedTimes);
  try {
    const Buffer<cl_uint>& source =
        static_detection_->refine(queue, model_.parameters, *model_.motion, rule);
    if (density_) density_->reorder(queue, source);
  } catch (const Error& problem) {  // continue unchanged
    if (!is_out_of_memory(problem)) throw;
    memory_is_short(problem.what());
    return false;
  }
  return true;
}

bool Population::put_in_order(Queue& queue) {
  try {
    const Buffer<cl_uint>& source = order_.sort(queue, model_.parameters, model_.shape.duration);
    if (density_) density_->reorder(queue, source);
  } catch (const Error& problem) {  // continue unsorted: slower, and different rounding
    if (!is_out_of_memory(problem)) throw;
    memory_is_short(problem.what());
    return false;
  }
  if (static_detection_) static_detection_->forget();
  return true;
}

void Population::save_state(Queue& queue, Arrays& arrays) const {
  if (density_) density_->save_state(queue, arrays);
  if (static_detection_) static_detection_->save_state(queue, model_.parameters, arrays);
}

void Population::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  if (density_) density_->load_state(queue, arrays, path);
  if (static_detection_) static_detection_->load_state(queue, model_.parameters, arrays, path);
}

}  // namespace gflow
