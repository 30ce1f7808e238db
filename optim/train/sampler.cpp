// SPDX-License-Identifier: Apache-2.0
#include "optim/train/sampler.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "optim/engine/random_streams.hpp"
#include "shared/random.h"

namespace gflow {

Sampler::Sampler(const TrainOptions& config, const Scene& scene, const FrameStore& frames,
                 const std::vector<FlowPair>& pairs, const FlowStore& flows,
                 std::vector<Rect> parts, const MotionShape& shape)
    : config_(config),
      scene_(scene),
      frames_(frames),
      parts_(std::move(parts)),
      curriculum_(Curriculum::of(config, is_permanent(shape.motion))),
      flow_every_(steps_to_flow(config.flow, shape.motion)),
      ways_(scene.train.size()) {
  require_sequence(config, scene, shape);
  const bool sequential = config.train.sequential;
  choices_.resize(sequential ? size_t(motion_model_of(shape.motion).keys(shape)) : 1);
  for (size_t i = 0; i < scene.train.size(); ++i) {
    const Camera& camera = frames.camera(scene.train[i]);
    const double area = i < parts_.size() ? double(parts_[i].width) * parts_[i].height : 0;
    Choice& choice = choices_[sequential ? size_t(scene.train[i].step) : 0];
    choice.frames.push_back(i);
    if (area > 0 && area < 0.6 * camera.width * camera.height) choice.focus.push_back(i);
  }
  const double begin = moment_to_begin(scene.train);
  if (curriculum_.steps > 0)
    for (std::vector<size_t>* order : {&choices_[0].frames, &choices_[0].focus})
      std::stable_sort(order->begin(), order->end(), [&](size_t a, size_t b) {
        return std::fabs(scene.train[a].time - begin) < std::fabs(scene.train[b].time - begin);
      });
  if (!config.flow.enabled || config.flow.weight == 0) return;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (!flows.has(i) || (sequential && !is_backward_in_time(scene, pairs[i]))) continue;
    Ways& ways = ways_[size_t(pairs[i].frame)];
    (pairs[i].span > 1 ? ways.far : ways.near).push_back(int(i));
  }
}

int Sampler::pair_at(size_t frame, int step, size_t turn) const {
  const Ways& ways = ways_[frame];
  const uint seed = uint(config_.train.seed);
  const bool reaches = ways.near.empty() ||
                       (!ways.far.empty() && random_uniform(seed, streams::kReach, uint(turn)) <=
                                                 config_.flow.long_share);
  const std::vector<int>& pairs = reaches ? ways.far : ways.near;
  if (pairs.empty() || step < config_.flow.start || stage(step).time_step == 0) return -1;
  return pairs[random_bits(seed, streams::kPair, uint(turn)) % pairs.size()];
}

std::vector<Sample> Sampler::at(int step) const {
  // One step in focus + 1 uses whole images, the others focus regions.
  const Choice& choice = choices_[size_t(std::max(stage(step).time_step, 0))];
  const int focus = choice.focus.empty() ? 0 : config_.train.focus;
  const bool whole = step % (focus + 1) == 0;
  const size_t turn = whole ? size_t(step) / size_t(focus + 1)
                            : size_t(step) - size_t(step) / size_t(focus + 1) - 1;
  const bool with_flow = turn % size_t(flow_every_) == 0;
  std::vector<Sample> samples;
  for (int b = 0; b < config_.train.batch; ++b) {
    const size_t at = turn * size_t(config_.train.batch) + size_t(b);
    const uint32_t seed = uint32_t(config_.train.seed);
    const std::vector<size_t>& frames = whole ? choice.frames : choice.focus;
    const uint32_t stream = whole ? seed : seed + 1000003u;
    const size_t i = frames[curriculum_.view_at(frames.size(), step, stream, at)];
    const Camera& camera = frames_.camera(scene_.train[i]);
    samples.push_back({&scene_.train[i], with_flow ? pair_at(i, step, at) : -1,
                       whole ? Rect{0, 0, camera.width, camera.height} : parts_[i]});
  }
  return samples;
}

}  // namespace gflow
