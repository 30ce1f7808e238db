// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/splat.hpp"

#include <algorithm>

#include "optim/engine/raster.hpp"

namespace gflow {
namespace {

// One group per tile: a single work-item if it holds LANES pixels, else one work-item per `pixels`
// pixels.
Range tile_groups(const Tiles& tiles, int lanes, int pixels) {
  return Range::groups(tiles.count(), lanes > 1 ? 1 : TILE * TILE / pixels);
}

}  // namespace

Splatting::Splatting(Queue& queue, const EngineSettings& settings, Channels channels)
    : lanes_(queue.lanes),
      settings_(settings),
      channels_(channels),
      program_(raster_program(queue, settings, channels)),
      tiles_with_flow_(program_, "tiles_with_flow"),
      splat_fwd_(program_, "splat_fwd"),
      splat_bwd_(program_, "splat_bwd"),
      gather_(program_, "gather") {}

const Buffer<cl_uchar>& Splatting::tiles_with_flow(Queue& queue, const Buffer<float>* flow_tiles,
                                                   size_t moving, const Tiles& tiles) {
  with_flow_.ensure(queue, tiles.count());
  no_choice_.ensure(queue, 0);
  tiles_with_flow_(queue, Range::over(tiles.count(), 16), cl_uint(tiles.count()),
                   cl_uint(std::min(moving, size_t(ALL_ROWS))), int(flow_tiles != nullptr),
                   flow_tiles ? *flow_tiles : no_choice_, tiles.tile_offsets, tiles.isect_ids,
                   with_flow_);
  return with_flow_;
}

void Splatting::forward(Queue& queue, const std::array<float, 3>& background, const Splats& splats,
                        const Tiles& tiles, Images& images, const Buffer<cl_uchar>* with_flow) {
  const size_t pixels = size_t(images.width) * images.height;
  images.rgb.ensure(queue, 3 * pixels);
  images.alpha.ensure(queue, pixels);
  images.depth.ensure(queue, channels_.depth ? pixels : 0);
  images.transmittance.ensure(queue, pixels);
  images.ends.ensure(queue, settings_.top_k ? 2 * pixels : pixels);
  images.background = background;
  if (channels_.flow || !with_flow) {
    images.flow.ensure(queue, channels_.flow ? 2 * pixels : 0);
    images.flow_weight.ensure(queue, channels_.flow && settings_.top_k ? pixels : 0);
  }
  no_tiles_.ensure(queue, 0);
  splat_fwd_(queue, tile_groups(tiles, lanes_, 1), images.width, images.height,
             int(with_flow != nullptr), with_flow ? *with_flow : no_tiles_, background[0],
             background[1], background[2], splats.records, tiles.tile_offsets, tiles.isect_ids,
             tiles.masks, images.rgb, images.alpha, images.depth, images.flow, images.flow_weight,
             images.transmittance, images.ends);
}

void Splatting::backward(Queue& queue, const Splats& splats, const Tiles& tiles,
                         const Images& images, const ImageGradients& v, Buffer<float>& partials,
                         bool shared) {
  partials.ensure(queue, MOMENTS * tiles.intersections);
  splat_bwd_(queue, tile_groups(tiles, lanes_, CELL), images.width, images.height, int(shared),
             splats.records, tiles.tile_offsets, tiles.isect_ids, tiles.isect_slots, tiles.masks,
             images.background[0], images.background[1], images.background[2], images.alpha,
             images.flow, images.flow_weight, images.transmittance, images.ends, v.v_rgb, v.v_alpha,
             v.v_depth, v.v_flow, partials);
}

void Splatting::gather(Queue& queue, const Splats& splats, const Tiles& tiles,
                       const Buffer<float>& partials, Buffer<float>& moments) {
  moments.ensure(queue, MOMENTS * splats.count);
  gather_(queue, Range::over(splats.count), cl_uint(splats.count), tiles.slot_offsets, partials,
          moments);
}

}  // namespace gflow
