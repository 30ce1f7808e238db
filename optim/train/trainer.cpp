// SPDX-License-Identifier: Apache-2.0
#include "optim/train/trainer.hpp"

#include <cmath>
#include <limits>

#include "optim/engine/random_streams.hpp"
#include "optim/motion/parameters_state.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr double kNotSeen = std::numeric_limits<double>::quiet_NaN();  // in this step

// A part of interleaved rows [H, W, channels].
template <class T>
void cut(const std::vector<T>& whole, int width, int channels, const Rect& part,
         std::vector<T>& out) {
  out.resize(size_t(part.width) * size_t(part.height) * size_t(channels));
  const size_t row = size_t(part.width) * size_t(channels);
  for (int y = 0; y < part.height; ++y) {
    const auto from = whole.begin() + (long(part.y + y) * width + part.x) * channels;
    std::copy(from, from + long(row), out.begin() + long(row) * y);
  }
}

// A part of [H, W, 2] as planes [2, h, w].
void cut_planes(const std::vector<float>& uv, int width, const Rect& part,
                std::vector<float>& planes) {
  const size_t pixels = size_t(part.width) * size_t(part.height);
  planes.resize(2 * pixels);
  size_t i = 0;
  for (int y = part.y; y < part.y + part.height; ++y)
    for (int x = part.x; x < part.x + part.width; ++x, ++i) {
      const size_t at = 2 * (size_t(y) * size_t(width) + size_t(x));
      planes[i] = uv[at];
      planes[pixels + i] = uv[at + 1];
    }
}

// nullptr when nothing is asked of the motion, or nothing can move.
std::unique_ptr<MotionLoss> motion_loss_for(Queue& queue, const LossConfig& loss,
                                            const Scene& scene) {
  MotionLossWeights w;
  const float times = float(loss.motion_every);
  w.rigidity = times * loss.rigidity;
  w.rotation = times * loss.rotation;
  w.isometry = times * loss.isometry;
  w.velocity = times * loss.velocity;
  w.acceleration = times * loss.acceleration;
  w.falloff = loss.neighbour_falloff;
  w.extent = float(scene.extent);
  if (scene.steps < 2 || !(w.any_pairs() || w.acceleration > 0)) return nullptr;
  return std::make_unique<MotionLoss>(queue, w);
}

// nullptr when the flow of all tiles counts in every step. A path with many numbers, each moved by
// few pictures, is shaken by pulls that are rare and strong: optim/loss/README.md.
std::unique_ptr<FlowTiles> flow_tiles_for(Queue& queue, const FlowConfig& flow,
                                          MotionModelKind motion) {
  const float share = flow.calm > 0 ? flow.calm : has_stiff_paths(motion) ? 0.1f : 1.f;
  return share < 1 ? std::make_unique<FlowTiles>(queue, CalmRule{share, flow.calm_px}) : nullptr;
}

// Of keys, bases, planes and networks; nullptr when there are none.
std::unique_ptr<Adam> path_adam_for(Queue& queue, const AdamGroups& adam,
                                    const Parameters& parameters) {
  const AdamConfig config{adam.beta1_paths, adam.beta2, false};
  return parameters.more.empty() ? nullptr : std::make_unique<Adam>(queue, config);
}

PinholeCamera part_of(PinholeCamera camera, const Rect& part) {
  camera.full_width = camera.width;
  camera.full_height = camera.height;
  camera.left = float(part.x);
  camera.top = float(part.y);
  camera.width = part.width;
  camera.height = part.height;
  return camera;
}

}  // namespace

Trainer::Trainer(Queue& queue, const TrainConfig& config, const Scene& scene, FrameStore& frames,
                 const std::vector<FlowPair>& pairs, FlowStore& flows, std::vector<Rect> parts,
                 Model& model, Guidance* guidance)
    : queue_(queue),
      config_(config),
      scene_(scene),
      frames_(frames),
      pairs_(pairs),
      flows_(flows),
      sampler_(config, scene, frames, pairs, flows, std::move(parts), model.shape),
      model_(model),
      rates_(config, scene, model.shape),
      renderer_(queue, engine_settings(config)),
      image_loss_(queue, config.loss.ssim),
      flow_loss_(queue, config.flow.robust_px),
      flow_tiles_(flow_tiles_for(queue, config.flow, model.shape.motion)),
      motion_loss_(motion_loss_for(queue, config.loss, scene)),
      adam_(queue, {config.adam.beta1, config.adam.beta2}),
      path_adam_(path_adam_for(queue, config.adam, model.parameters)),
      population_(queue, config, scene, model),
      guide_(guidance ? std::make_unique<Guide>(queue, config, scene, frames, *guidance) : nullptr),
      reduce_(queue) {}

Trainer::~Trainer() {
  try {
    queue_.finish();
  } catch (const Error&) {  // of a device that failed, which whoever used it was told
  }
}

int Trainer::sh_degree(int step) const {
  return std::min(config_.motion.sh_degree, step / config_.motion.sh_interval);
}

std::array<uint8_t, 3> Trainer::background(int step) const {
  if (config_.scene.background != Background::random || !scene_.has_alpha) {
    const uint8_t level = shown_level(config_.scene.background);
    return {level, level, level};
  }
  const uint bits = random_bits(uint(config_.train.seed), streams::kBackground, uint(step));
  return {uint8_t(bits >> 8), uint8_t(bits >> 16), uint8_t(bits >> 24)};
}

void Trainer::prefetch(int step) {
  std::vector<const Frame*> frames;
  std::vector<size_t> flows;
  for (int next = step + 1; next < config_.train.iterations; ++next) {
    for (const Sample& sample : sampler_.at(next)) {
      if (next == step + 1) frames.push_back(sample.frame);
      if (sample.pair >= 0) flows.push_back(size_t(sample.pair));
    }
    const bool enough = flows_.at_hand() || next - step >= int(flows_.worth_prefetching());
    if (enough) break;
  }
  frames_.prefetch(frames);
  flows_.prefetch(flows);
}

void Trainer::step(Queue& queue, int step) {
  untouched_ = true;
  prefetch(step);
  if (step == 0 && population_.put_in_order(queue)) neighbours_known_ = false;
  renew_neighbours_if_due(queue, step);
  if (config_.skip.unseen)
    model_.parameters.forget_seen(queue);
  else
    model_.parameters.count_as_seen(queue);
  const Stage now = stage(step);
  if (now.begins && now.time_step > 0)
    model_.motion->start_key(queue, model_.parameters, now.time_step);
  if (guide_ && guide_->due(step)) guide(queue, step);  // first: it may fail
  int in_batch = 0;
  for (const Sample& sample : sampler_.at(step)) train_view(queue, sample, step, in_batch++);
  update(queue, step);
  if (population_.after_step(queue, renderer_, now, step, rates_.position(step)))
    neighbours_known_ = false;
}

// The binning of the view before waited for what it had uploaded: that is free now.
float Trainer::upload_teacher(Queue& queue, const Sample& sample, int width) {
  const Rect& part = sample.part;
  const auto flow = flows_.get(size_t(sample.pair));
  cut_planes(flow->flow.uv, width, part, flow_planes_);
  cut(config_.flow.confidence ? flow->confidence : flow->flow.valid, width, 1, part,
      confidence_part_);
  if (!config_.flow.confidence)
    for (cl_uchar& c : confidence_part_) c = c ? 255 : 0;
  teacher_.ensure(queue, flow_planes_.size());
  teacher_.write_async(queue, flow_planes_);
  confidence_.ensure(queue, confidence_part_.size());
  confidence_.write_async(queue, confidence_part_);
  const auto unknown = std::count(confidence_part_.begin(), confidence_part_.end(), 0);
  v_.flow_in_parts = size_t(unknown) > confidence_part_.size() / 4;
  return config_.flow.weight * float(sampler_.flow_every()) * flow->emphasis;
}

void Trainer::train_view(Queue& queue, const Sample& sample, int step, int in_batch) {
  const Camera& camera = frames_.camera(*sample.frame);
  const Rect& part = sample.part;
  const size_t pixels = size_t(part.width) * size_t(part.height);
  const float share = float(double(pixels) / (double(camera.width) * camera.height));
  Shot shot;
  shot.view.camera = part_of(pinhole(camera, config_.render.near), part);
  shot.view.camera_t2 = shot.view.camera;
  shot.time = sample.frame->time;
  shot.sh_degree = sh_degree(step);
  const std::array<uint8_t, 3> behind = background(step);
  for (size_t c = 0; c < 3; ++c) shot.background[c] = float(behind[c]) / 255;
  had_flow_ = sample.pair >= 0;
  float flow_weight = 0;
  if (had_flow_) {
    const FlowPair& pair = pairs_[size_t(sample.pair)];
    if (pair.next >= 0) {
      const Frame& next = scene_.train[size_t(pair.next)];
      shot.view.camera_t2 = part_of(pinhole(frames_.camera(next), config_.render.near), part);
      shot.time_t2 = next.time;
    } else {
      shot.time_t2 = sample.frame->flow_time;
    }
    shot.flow = true;
    flow_weight = share * upload_teacher(queue, sample, camera.width);
    if (flow_tiles_)
      shot.view.flow_tiles =
          &flow_tiles_->choose(queue,
                               random_bits(uint(config_.train.seed), streams::kTileSeed,
                                           uint(step) * uint(config_.train.batch) + uint(in_batch)),
                               part.width, part.height, teacher_, confidence_);
  } else {  // for a motion loss: the next step in time, or the one before
    const double later = shot.time + 1.0 / std::max(scene_.steps - 1, 1);
    shot.time_t2 = later < 1 + 1e-6 ? later : 2 * shot.time - later;
  }
  if (step % config_.loss.motion_every == 0) shot.motion_loss = motion_loss_.get();
  shot.all_posed = population_.needs_all_posed();
  had_motion_loss_ = shot.motion_loss;
  renderer_.forward(queue, model_, shot);
  empty_pictures_ = renderer_.engine().tiles().intersections > 0 ? 0 : empty_pictures_ + 1;

  // The binning above waited for the queue: what earlier steps uploaded from is free now.
  // The store keeps pictures on its own background; another is put behind the part that is drawn.
  const bool as_shown = behind == frames_.background();
  const auto picture = as_shown ? frames_.rgb(*sample.frame) : frames_.picture(*sample.frame);
  cut(picture->pixels, camera.width, picture->channels, part, picture_part_);
  if (picture->channels == 4)
    picture_part_ =
        over_background({part.width, part.height, 4, std::move(picture_part_)}, behind).pixels;
  v_.v_rgb.ensure(queue, 3 * pixels);
  v_.v_alpha.ensure(queue, pixels);
  v_.v_alpha.fill(queue, 0.f);
  const Images& images = renderer_.images();
  compare_with_picture(queue, part.width, part.height, share);
  if (had_flow_) {
    v_.v_flow.ensure(queue, 2 * pixels);
    flow_loss_.run(queue, flow_weight, part.width, part.height, images.flow, images.alpha, teacher_,
                   confidence_, v_.v_flow, shot.view.flow_tiles);
    flow_is_new_ = true;
  }
  renderer_.backward(queue, model_, v_);
  untouched_ = false;
  population_.see(queue, renderer_, shot, camera.width, camera.height);
}

void Trainer::compare_with_picture(Queue& queue, int width, int height, float share) {
  const Buffer<float>& rgb = renderer_.images().rgb;
  if (config_.skip.compact) {
    truth_.ensure(queue, picture_part_.size());
    truth_.write_async(queue, picture_part_);
    return image_loss_.run(queue, width, height, rgb, truth_, v_.v_rgb, share);
  }
  picture_floats_.resize(picture_part_.size());
  std::transform(picture_part_.begin(), picture_part_.end(), picture_floats_.begin(),
                 [](cl_uchar byte) { return float(byte) / 255; });  // rounded as the kernel does
  truth_floats_.ensure(queue, picture_floats_.size());
  truth_floats_.write_async(queue, picture_floats_);
  image_loss_.run(queue, width, height, rgb, truth_floats_, v_.v_rgb, share);
}

void Trainer::guide(Queue& queue, int step) {
  Guide::Moment moment;
  moment.frame = sampler_.at(step).front().frame;
  moment.background = background(step);
  moment.sh_degree = sh_degree(step);
  guide_->run(queue, model_, renderer_, step, moment, [&](const Shot& shot) {
    untouched_ = false;
    population_.see(queue, renderer_, shot, shot.view.camera.width, shot.view.camera.height);
  });
}

void Trainer::renew_neighbours_if_due(Queue& queue, int step) {
  if (!motion_loss_ || !motion_loss_->weights().any_pairs()) return;
  const LossConfig& loss = config_.loss;
  if (neighbours_known_ && step % loss.neighbours_every != 0) return;
  // Each looks for its own in the middle of its life; ten moments tell lives apart well enough.
  const NeighbourRule rule{size_t(loss.neighbours), model_.shape.duration,
                           size_t(std::min(scene_.steps, 10))};
  motion_loss_->set_pairs(queue, find_neighbours(queue, model_.parameters, *model_.motion, rule));
  neighbours_known_ = true;
}

void Trainer::update(Queue& queue, int step) {
  untouched_ = false;
  const LearningRates& lr = config_.lr;
  const Stage now = stage(step);
  Parameters& p = model_.parameters;
  if (step % 100 == 0) {  // new Gaussians and changed lifetimes; density control too
    const float time_step = model_.shape.duration / float(std::max(scene_.steps, 1));
    model_.motion->set_pace(queue, p, {model_.shape.duration, time_step, lr.pace, lr.pace_most});
  }
  model_.motion->regularize(
      queue, p,
      {config_.hexplane.plane_tv, config_.hexplane.time_smoothness, config_.hexplane.l1_time});
  const bool warming = sampler_.unfolding().warming(step);
  if (now.time_step > 0) {  // one key alone; a flow leads to the one before
    Table& keys = p.more[0];
    keys.rows.seen.fill_range(queue, 0, size_t(now.time_step) * p.moving, 0u);
  }
  population_.add_gradients(queue);
  const auto unused = [&](const GroupSpec& spec) {
    return config_.skip.bands && spec.quantity == Quantity::color_rest && sh_degree(step) == 0;
  };
  for (Table* table : p.tables()) {
    const bool moving = table != &p;
    if (moving ? !now.moves() || warming : !now.fits()) continue;
    Adam& adam = moving ? *path_adam_ : adam_;
    for (size_t g = 0; g < table->groups.size(); ++g)
      if (!unused(table->specs[g]))
        adam.refuse(queue, table->groups[g], table->rows, table->active_in(table->specs[g]));
    adam.advance(queue, table->rows, table->active);
    for (size_t g = 0; g < table->groups.size(); ++g) {
      const GroupSpec& spec = table->specs[g];
      if (unused(spec)) continue;
      // Photographs of one moment; and who is trained moment by moment has no time of its own.
      if (spec.motion && (scene_.steps < 2 || now.time_step == 0)) continue;
      adam.step(queue, table->groups[g], table->rows, table->active_in(spec),
                rates_.of(spec, step));
    }
  }
}

Arrays Trainer::state(Queue& queue) {
  Arrays arrays;
  save_state(queue, model_.parameters, arrays);
  population_.save_state(queue, arrays);
  if (motion_loss_ && neighbours_known_) save_state(motion_loss_->pairs(), arrays);
  if (rates_.caution != 1) arrays["caution"] = {{1}, std::vector<float>{rates_.caution}};
  // For the log of a step without flow.
  const FlowFigures flow = flow_figures(queue);
  if (sampler_.flow_every() > 1 && flow.known)
    arrays["flow_figures"] = {{2}, std::vector<float>{flow.loss, flow.epe}};
  return arrays;
}

void Trainer::set_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  load_state(queue, model_.parameters, arrays, path);
  population_.load_state(queue, arrays, path);
  const bool cautious = arrays.count("caution");
  rates_.caution = cautious ? exact_values<float>(arrays, "caution", {1}, path)[0] : 1;
  flow_is_new_ = false;
  flow_figures_ = {};
  if (arrays.count("flow_figures")) {
    const std::vector<float>& flow = exact_values<float>(arrays, "flow_figures", {2}, path);
    flow_figures_ = {true, flow[0], flow[1]};
  }
  neighbours_known_ = motion_loss_ && arrays.count("neighbours/offsets");
  if (neighbours_known_)
    motion_loss_->set_pairs(queue, load_neighbours(arrays, model_.parameters.count, path));
}

StepFigures Trainer::counts(Queue& queue) {
  constexpr cl_uint ten_steps = 10;
  StepFigures counts;
  const Parameters& p = model_.parameters;
  counts.gaussians = p.count;
  counts.moving = p.moving;
  counts.refused = reduce_.count_nonzero(queue, p.rows.refused);
  for (size_t t = 0; t < p.more.size(); ++t) {
    const Buffer<cl_uint>& refused = p.more[t].rows.refused;
    counts.refused += reduce_.count_nonzero(queue, refused);
    if (p.more_specs[t].rows > 0) counts.stuck += reduce_.count_above(queue, refused, ten_steps);
  }
  return counts;
}

Trainer::FlowFigures Trainer::flow_figures(Queue& queue) {
  if (flow_is_new_) {
    const FlowLossValue flow = flow_loss_.value(queue);
    const bool none_asked = flow_tiles_ && flow.confident_pixels == 0;
    flow_figures_ = {!none_asked, float(flow.loss / sampler_.flow_every()), float(flow.epe)};
    flow_is_new_ = false;
  }
  return flow_figures_;
}

std::string Trainer::take_notice() {
  const int many = std::min(100, config_.train.iterations);
  if (empty_pictures_ < many || emptiness_told_) return population_.take_notice();
  emptiness_told_ = true;
  return fmt::format(
      "no Gaussian was in sight in {} pictures in a row: do the cameras' poses and the points to "
      "start from belong together?",
      many);
}

StepFigures Trainer::figures(Queue& queue) {
  StepFigures figures = counts(queue);
  const ImageLossValue image = image_loss_.value(queue);
  figures.l1 = image.l1;
  figures.ssim = image.ssim;
  figures.loss = image.total;
  const bool has_flow = flows_.size() > 0 && config_.flow.weight > 0;
  if (had_flow_ || (has_flow && sampler_.flow_every() > 1)) {
    const FlowFigures flow = flow_figures(queue);
    figures.flow_loss = flow.known ? double(flow.loss) : kNotSeen;
    figures.epe = flow.known ? double(flow.epe) : kNotSeen;
    figures.loss += double(flow.loss);
  }
  if (had_motion_loss_) {
    figures.motion = motion_loss_->value(queue);
    figures.loss += figures.motion->total();
  } else if (motion_loss_) {
    figures.motion = MotionLossValue{kNotSeen, kNotSeen, kNotSeen, kNotSeen, kNotSeen};
  }
  if (guide_) figures.guidance = guide_->figures(queue);
  const std::vector<float> rgb = renderer_.images().rgb.read(queue);
  double sum = 0;
  const size_t pixels = rgb.size() / 3;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < pixels; ++i) {
      const double d =
          std::clamp(double(rgb[c * pixels + i]), 0.0, 1.0) - picture_part_[3 * i + c] / 255.0;
      sum += d * d;
    }
  figures.psnr = -10 * std::log10(std::max(sum / double(rgb.size()), 1e-12));
  return figures;
}

}  // namespace gflow
