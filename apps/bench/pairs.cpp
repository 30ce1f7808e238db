// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/pairs.hpp"

#include <numeric>

#include "runtime/kernel.hpp"

namespace gflow::bench {

Pairs count_pairs(Queue& queue, const Engine& engine, const EngineSettings& settings) {
  Program program(queue, "count_pairs.cl", {{"EXCLUDE", int(settings.stop == StopRule::exclude)}});
  Kernel<cl_int, cl_int, In<float>, In<cl_uint>, In<cl_uint>, In<cl_ushort>, Out<cl_uint>,
         Out<cl_uint>, Out<cl_uint>>
      count(program, "count_pairs");
  const Images& images = engine.images();
  const size_t pixels = size_t(images.width) * size_t(images.height);
  Buffer<cl_uint> listed(queue, pixels, "listed pairs"), masked(queue, pixels, "masked pairs");
  Buffer<cl_uint> blended(queue, pixels, "blended pairs");
  const Tiles& tiles = engine.tiles();
  count(queue, Range::grid(size_t(images.width), size_t(images.height)), images.width,
        images.height, engine.splats().records, tiles.tile_offsets, tiles.isect_ids, tiles.masks,
        listed, masked, blended);
  const auto sum = [&](const Buffer<cl_uint>& buffer) {
    const std::vector<cl_uint> counts = buffer.read(queue);
    return std::accumulate(counts.begin(), counts.end(), 0.0);
  };
  return {sum(listed), sum(masked), sum(blended)};
}

// Forward: exponent 8, exp2 13, cut, weight and what passes 5, colour 6; flow 12, depth 2. Backward
// repeats 26 of them, and adds 26 for what colour and alpha pull at, 28 for flow, 4 for depth.
double forward_flops(Channels c) { return 32 + (c.flow ? 12 : 0) + (c.depth ? 2 : 0); }
double backward_flops(Channels c) { return 52 + (c.flow ? 28 : 0) + (c.depth ? 4 : 0); }

double bytes_of(const Touched& t) {
  return 7 * 4 * t.parameters * t.moved + 900 * t.drawn + 310 * t.intersections + 110 * t.pixels;
}

}  // namespace gflow::bench
