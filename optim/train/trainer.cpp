// SPDX-License-Identifier: Apache-2.0
#include "optim/train/trainer.hpp"

#include <cmath>
#include <numeric>

#include "shared/random.h"

namespace gflow {
namespace {

EngineSettings engine_settings(const FlowConfig& flow) {
  EngineSettings settings;
  settings.transport = flow.transport;
  settings.stop = flow.stop;
  settings.top_k = flow.top_k;
  settings.detach_t1 = flow.detach_t1;
  return settings;
}

// a at 0, b at 1, geometrically between.
float between_rates(float a, float b, double share) {
  return a > 0 ? float(a * std::pow(double(b) / a, share)) : 0.f;
}

// [H, W, 2] to [2, H, W].
void to_planes(const std::vector<float>& uv, std::vector<float>& planes) {
  const size_t pixels = uv.size() / 2;
  planes.resize(uv.size());
  for (size_t i = 0; i < pixels; ++i) {
    planes[i] = uv[2 * i];
    planes[pixels + i] = uv[2 * i + 1];
  }
}

}  // namespace

size_t shuffled(size_t n, uint32_t seed, size_t i) {
  const uint round = uint(i / n);
  std::vector<size_t> order(n);
  std::iota(order.begin(), order.end(), size_t(0));
  for (size_t k = n - 1; k > 0; --k)  // Fisher, Yates
    std::swap(order[k], order[random_bits(seed, round, uint(k)) % (k + 1)]);
  return order[i % n];
}

Trainer::Trainer(Queue& queue, const TrainConfig& config, const Scene& scene, FrameStore& frames,
                 const std::vector<FlowPair>& pairs, FlowStore& flows, Model& model)
    : config_(config),
      scene_(scene),
      frames_(frames),
      pairs_(pairs),
      flows_(flows),
      model_(model),
      renderer_(queue, engine_settings(config.flow)),
      image_loss_(queue, config.loss.ssim),
      flow_loss_(queue, config.flow.robust_px),
      adam_(queue, {config.adam.beta1, config.adam.beta2}),
      density_(queue),
      reduce_(queue),
      pair_of_frame_(scene.train.size(), -1) {
  const float level = config.scene.background == Background::white ? 1.f : 0.f;
  background_ = {level, level, level};
  if (!config.flow.enabled || config.flow.weight == 0) return;
  for (size_t i = 0; i < pairs.size(); ++i)
    if (flows.has(i)) pair_of_frame_[size_t(pairs[i].frame)] = int(i);
}

int Trainer::sh_degree(int step) const {
  return std::min(config_.motion.sh_degree, step / config_.motion.sh_interval);
}

std::vector<Trainer::Sample> Trainer::samples(int step) const {
  std::vector<Sample> samples;
  for (int b = 0; b < config_.train.batch; ++b) {
    const size_t i = shuffled(scene_.train.size(), uint32_t(config_.train.seed),
                              size_t(step) * size_t(config_.train.batch) + size_t(b));
    samples.push_back(
        {&scene_.train[i], step >= config_.flow.start ? pair_of_frame_[i] : -1});
  }
  return samples;
}

void Trainer::step(Queue& queue, int step) {
  std::vector<const Frame*> next;
  for (const Sample& sample : samples(step + 1)) next.push_back(sample.frame);
  frames_.prefetch(next);
  model_.parameters.rows.seen.fill(queue, 0u);
  for (const Sample& sample : samples(step)) train_view(queue, sample, step);
  update(queue, step);
  refine_if_due(queue, step);
}

void Trainer::train_view(Queue& queue, const Sample& sample, int step) {
  const Camera& camera = frames_.camera(*sample.frame);
  const size_t pixels = size_t(camera.width) * size_t(camera.height);
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, config_.render.near);
  shot.time = sample.frame->time;
  shot.sh_degree = sh_degree(step);
  shot.background = background_;
  had_flow_ = sample.pair >= 0;
  if (had_flow_) {
    const FlowPair& pair = pairs_[size_t(sample.pair)];
    if (pair.next >= 0) {
      const Frame& next = scene_.train[size_t(pair.next)];
      shot.view.camera_t2 = pinhole(frames_.camera(next), config_.render.near);
      shot.time_t2 = next.time;
    } else {
      shot.time_t2 = sample.frame->flow_time;
    }
    shot.flow = true;
  }
  renderer_.forward(queue, model_, shot);

  // The binning above waited for the queue: what earlier steps uploaded from is free now.
  picture_ = frames_.rgb(*sample.frame);
  truth_.ensure(queue, 3 * pixels);
  truth_.write_async(queue, picture_->pixels);
  v_.v_rgb.ensure(queue, 3 * pixels);
  v_.v_alpha.ensure(queue, pixels);
  v_.v_alpha.fill(queue, 0.f);
  const Images& images = renderer_.images();
  image_loss_.run(queue, camera.width, camera.height, images.rgb, truth_, v_.v_rgb);
  if (had_flow_) {
    flow_ = flows_.get(size_t(sample.pair));
    to_planes(flow_->flow.uv, flow_planes_);
    teacher_.ensure(queue, 2 * pixels);
    teacher_.write_async(queue, flow_planes_);
    confidence_.ensure(queue, pixels);
    confidence_.write_async(queue,
                            config_.flow.confidence ? flow_->confidence : flow_->flow.valid);
    v_.v_flow.ensure(queue, 2 * pixels);
    flow_loss_.run(queue, config_.flow.weight, camera.width, camera.height, images.flow,
                   images.alpha, teacher_, confidence_, v_.v_flow);
  }
  renderer_.backward(queue, model_, v_);
  if (config_.density.enabled)
    density_.accumulate(queue, camera.width, camera.height,
                        renderer_.engine().splats().tiles_touched,
                        renderer_.gradients().v_means2d, model_.parameters.count);
}

void Trainer::update(Queue& queue, int step) {
  const LearningRates& lr = config_.lr;
  const AdamGroups& eps = config_.adam;
  const double share = double(step) / config_.train.iterations;
  const float extent = float(scene_.extent);
  const std::map<std::string, AdamRate> rates{
      {"means", {extent * between_rates(lr.means, lr.means_final, share), eps.eps_means}},
      {"means_t", {lr.mean_t * model_.shape.duration, eps.eps_means}},
      {"quats", {between_rates(lr.quats, lr.quats_final, share), eps.eps_quats}},
      {"quats_r", {between_rates(lr.quats, lr.quats_final, share), eps.eps_quats}},
      {"log_scales", {lr.scales, eps.eps_scales}},
      {"logit_opacities", {lr.opacity, eps.eps_opacity}},
      {"sh0", {lr.sh, eps.eps_sh}},
      {"sh_rest", {lr.sh / lr.sh_rest_divisor, eps.eps_sh}}};
  Parameters& p = model_.parameters;
  for (const ParameterGroup& group : p.groups) adam_.refuse(queue, group, p.rows, p.count);
  adam_.advance(queue, p.rows, p.count);
  for (size_t g = 0; g < p.groups.size(); ++g) {
    if (p.specs[g].name == "sh_rest" && sh_degree(step) == 0) continue;
    adam_.step(queue, p.groups[g], p.rows, p.count, rates.at(p.specs[g].name));
  }
}

void Trainer::refine_if_due(Queue& queue, int step) {
  const DensityConfig& d = config_.density;
  const int done = step + 1;
  if (!d.enabled || done < d.start || done % d.every != 0 ||
      done > d.stop_fraction * float(config_.train.iterations))
    return;
  DensityRule rule;
  rule.grad_threshold = d.grad_threshold;
  rule.min_opacity = d.prune_opacity;
  rule.max_scale = d.prune_scale * float(scene_.extent);
  rule.split.split_scale = d.split_scale * float(scene_.extent);
  rule.split.split_travel = d.split_travel;
  rule.split.duration = model_.shape.duration;
  rule.split.min_lifetime = d.min_lifetime * model_.shape.duration / float(std::max(scene_.steps, 1));
  rule.cutoff = model_.shape.cutoff;
  rule.cap = size_t(d.cap);
  density_.refine(queue, model_.parameters, *model_.motion, rule,
                  random_bits(uint32_t(config_.train.seed), 7u, uint32_t(step)));
}

StepFigures Trainer::figures(Queue& queue) {
  StepFigures figures;
  const ImageLossValue image = image_loss_.value(queue);
  figures.l1 = image.l1;
  figures.ssim = image.ssim;
  figures.loss = image.total;
  if (had_flow_) {
    const FlowLossValue flow = flow_loss_.value(queue);
    figures.flow_loss = flow.loss;
    figures.epe = flow.epe;
    figures.loss += flow.loss;
  }
  figures.gaussians = model_.parameters.count;
  figures.refused = reduce_.count_nonzero(queue, model_.parameters.rows.refused);
  const std::vector<float> rgb = renderer_.images().rgb.read(queue);
  double sum = 0;
  const size_t pixels = rgb.size() / 3;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < pixels; ++i) {
      const double d = std::clamp(double(rgb[c * pixels + i]), 0.0, 1.0) -
                       picture_->pixels[3 * i + c] / 255.0;
      sum += d * d;
    }
  figures.psnr = -10 * std::log10(std::max(sum / double(rgb.size()), 1e-12));
  return figures;
}

}  // namespace gflow
