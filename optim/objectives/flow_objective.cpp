// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/flow_objective.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "optim/objectives/crop.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

// nullptr if all tiles are evaluated in every step. Paths with many parameters, each trained by few
// images, do not converge with rare and strong gradients: optim/loss/README.md.
std::unique_ptr<FlowTiles> flow_tiles_for(Queue& queue, const FlowOptions& flow,
                                          MotionModelKind motion) {
  const float share = flow.low_motion > 0 ? flow.low_motion : has_stiff_paths(motion) ? 0.1f : 1.f;
  return share < 1 ? std::make_unique<FlowTiles>(queue, LowMotionRule{share, flow.low_motion_px})
                   : nullptr;
}

}  // namespace

FlowObjective::FlowObjective(Queue& queue, const TrainOptions& options, const Scene& scene,
                             FrameStore& frames, const std::vector<FlowPair>& pairs,
                             FlowStore& flows, MotionModelKind motion)
    : options_(options),
      scene_(scene),
      frames_(frames),
      pairs_(pairs),
      flows_(flows),
      every_(steps_to_flow(options.flow, motion)),
      loss_(queue, options.flow.robust_px),
      tiles_(flow_tiles_for(queue, options.flow, motion)) {}

// Binning of the previous view has waited for the queue, so the host arrays of its uploads are
// free.
void FlowObjective::upload_target(Queue& queue, const ViewContext& view) {
  const Rect& part = view.sample.part;
  const auto flow = flows_.get(size_t(view.sample.pair));
  const bool checked = options_.flow.confidence;
  crop_planes(flow->flow.uv, view.width, part, planes_);
  crop(checked ? flow->confidence : flow->flow.valid, view.width, 1, part, confidence_bytes_);
  if (!checked)
    for (cl_uchar& c : confidence_bytes_) c = c ? 255 : 0;
  if (const auto counted = frames_.counted(*view.sample.frame)) {
    crop(counted->pixels, view.width, 1, part, counted_bytes_);
    for (size_t i = 0; i < counted_bytes_.size(); ++i) confidence_bytes_[i] &= counted_bytes_[i];
  }
  target_.ensure(queue, planes_.size());
  target_.write_async(queue, planes_);
  confidence_.ensure(queue, confidence_bytes_.size());
  confidence_.write_async(queue, confidence_bytes_);
  const auto unknown = std::count(confidence_bytes_.begin(), confidence_bytes_.end(), 0);
  in_parts_ = size_t(unknown) > confidence_bytes_.size() / 4;
  weight_ = view.share * (options_.flow.weight * float(every_) * flow->emphasis);
}

void FlowObjective::request(Queue& queue, const ViewContext& view, Shot& shot) {
  had_flow_ = view.sample.pair >= 0;
  if (!had_flow_) return;
  const FlowPair& pair = pairs_[size_t(view.sample.pair)];
  if (pair.next >= 0) {
    const Frame& next = scene_.train[size_t(pair.next)];
    shot.view.camera_t2 =
        crop(pinhole(frames_.camera(next), near_or_default(options_.render.near, scene_)),
             view.sample.part);
    shot.time_t2 = next.time;
  } else {
    shot.time_t2 = view.sample.frame->flow_time;
  }
  shot.flow = true;
  upload_target(queue, view);
  if (!tiles_) return;
  const uint index = uint(view.step) * uint(options_.train.batch) + uint(view.in_batch);
  const uint seed = random_bits(uint(options_.train.seed), streams::kTileSeed, index);
  const Rect& part = view.sample.part;
  shot.view.flow_tiles =
      &tiles_->choose(queue, seed, part.width, part.height, target_, confidence_);
}

void FlowObjective::add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                                  ImageGradients& v) {
  if (!had_flow_) return;
  const Rect& part = view.sample.part;
  const Images& images = renderer.images();
  v.flow_in_parts = in_parts_;
  v.v_flow.ensure(queue, 2 * size_t(part.width) * size_t(part.height));
  loss_.run(queue, weight_, part.width, part.height, images.flow, images.alpha, target_,
            confidence_, v.v_flow, renderer.shot().view.flow_tiles);
  is_new_ = true;
}

FlowObjective::Values FlowObjective::values(Queue& queue) {
  if (is_new_) {
    const FlowLossValue flow = loss_.value(queue);
    const bool none_evaluated = tiles_ && flow.confident_pixels == 0;
    values_ = {!none_evaluated, float(flow.loss / every_), float(flow.epe)};
    is_new_ = false;
  }
  return values_;
}

void FlowObjective::report(Queue& queue, const Renderer&, LossReport& report) {
  double loss = 0, epe = 0;
  const bool has_flow = flows_.size() > 0 && options_.flow.weight > 0;
  if (had_flow_ || (has_flow && every_ > 1)) {
    const Values last = values(queue);
    loss = last.known ? double(last.loss) : std::nan("");
    epe = last.known ? double(last.epe) : std::nan("");
    report.loss += double(last.loss);
  }
  report.terms.push_back({"flow_loss", loss, ""});
  report.terms.push_back({"flow_epe", epe, epe > 0 ? fmt::format("epe {:.2f} px", epe) : ""});
}

// Needed for the log of a step without flow.
void FlowObjective::save_state(Queue& queue, Arrays& arrays) {
  const Values last = values(queue);
  if (every_ > 1 && last.known)
    arrays["flow_figures"] = {{2}, std::vector<float>{last.loss, last.epe}};
}

void FlowObjective::load_state(Queue&, const Arrays& arrays, const std::string& path) {
  is_new_ = false;
  values_ = {};
  if (!arrays.count("flow_figures")) return;
  const std::vector<float>& flow = exact_values<float>(arrays, "flow_figures", {2}, path);
  values_ = {true, flow[0], flow[1]};
}

}  // namespace gflow
