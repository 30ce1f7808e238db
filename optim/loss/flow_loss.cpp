// SPDX-License-Identifier: Apache-2.0
// Launches kernels/loss/flow_loss.cl.
#include "optim/loss/flow_loss.hpp"

#include <cmath>

#include "shared/constants.h"
#include "shared/loss.h"

namespace gflow {
namespace {

float checked_knee(float robust_px) {
  if (!(robust_px > 0 && std::isfinite(robust_px)))
    throw Error(fmt::format("flow loss: robust_px is {}, it must be above 0", robust_px));
  return robust_px;
}

}  // namespace

FlowLoss::FlowLoss(Queue& queue, float robust_px)
    : robust_px_(checked_knee(robust_px)),
      lanes_(size_t(queue.lanes)),
      program_(queue, "common.cl"),
      flow_loss_(program_, "flow_loss"),
      reduce_(queue),
      terms_("flow loss terms") {}

void FlowLoss::run(Queue& queue, float weight, int width, int height, const Buffer<float>& flow,
                   const Buffer<float>& alpha, const Buffer<float>& target_flow,
                   const Buffer<cl_uchar>& confidence, Buffer<float>& v_flow,
                   const Buffer<float>* tile_weights) {
  const size_t pixels = size_t(width) * height;
  if (flow.size() < 2 * pixels || target_flow.size() < 2 * pixels || v_flow.size() < 2 * pixels ||
      alpha.size() < pixels || confidence.size() < pixels)
    throw Error(fmt::format(
        "flow loss of {} x {} pixels: {} has {} values, {} {}, {} {}, {} {}, {} {}; flows need two "
        "per pixel, alpha and confidence one",
        width, height, flow.name(), flow.size(), target_flow.name(), target_flow.size(),
        v_flow.name(), v_flow.size(), alpha.name(), alpha.size(), confidence.name(),
        confidence.size()));
  const size_t tiles = ((size_t(width) + TILE - 1) / TILE) * ((size_t(height) + TILE - 1) / TILE);
  if (tile_weights && tile_weights->size() < tiles)
    throw Error(fmt::format("flow loss of {} x {} pixels: {} has {} values for {} tiles", width,
                            height, tile_weights->name(), tile_weights->size(), tiles));
  terms_.ensure(queue, 3 * pixels);
  no_weights_.ensure(queue, 0);
  const size_t runs = (size_t(width) + lanes_ - 1) / lanes_;  // runs of LANES pixels in a row
  flow_loss_(queue, Range::over(runs * size_t(height), 64), cl_uint(width), cl_uint(height),
             weight / float(pixels), robust_px_, int(tile_weights != nullptr),
             tile_weights ? *tile_weights : no_weights_, flow, alpha, target_flow, confidence,
             v_flow, terms_);
  pixels_ = pixels;
}

FlowLossValue FlowLoss::value(Queue& queue) {
  if (pixels_ == 0) throw Error("flow loss: its value was read before its first run");
  FlowLossValue value;
  value.loss = reduce_.sum(queue, terms_, 0, pixels_);
  value.confident_pixels = reduce_.sum(queue, terms_, 2 * pixels_, pixels_);
  if (value.confident_pixels > 0)
    value.epe = reduce_.sum(queue, terms_, pixels_, pixels_) / value.confident_pixels;
  return value;
}

size_t confident_pixels(const std::vector<float>& target_flow,
                        const std::vector<cl_uchar>& confidence) {
  const size_t pixels = confidence.size();
  if (target_flow.size() != 2 * pixels)
    throw Error(fmt::format(
        "counting confident pixels: {} flow values for {} pixels, expected two per pixel",
        target_flow.size(), pixels));
  size_t count = 0;
  for (size_t i = 0; i < pixels; ++i)
    count += confidence[i] != 0 && std::fabs(target_flow[i]) <= TARGET_FLOW_LIMIT &&
             std::fabs(target_flow[pixels + i]) <= TARGET_FLOW_LIMIT;
  return count;
}

}  // namespace gflow
