// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/pairs.hpp"

#include <cmath>
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

double bytes_of_stage(const std::string& stage, const Touched& t, Channels c) {
  const double pose = 12 + 36, record = 64, flow = c.flow;  // a mean and a factor; a splat
  const double planes = 4 * (6 + 2 * flow + c.depth);       // images of splat.cl
  if (stage == "mask") return t.intersections * (4 + record / 2 + 2);
  if (stage == "transport") return t.drawn * (4 + 12 + 2 * pose * flow + 36);
  if (stage == "splat") return t.intersections * (4 + 2 + record) + t.pixels * planes;
  if (stage == "backward")
    return t.intersections * (4 + 4 + 2 + 2 * record) +
           t.pixels * (planes + 4 * (4 + 2 * flow + c.depth));
  if (stage == "gather") return t.intersections * record + t.drawn * (4 + record);
  if (stage == "project back")
    return t.drawn * (4 + 4 + record + (1 + flow) * 2 * pose + 4 + 12 + 8);
  if (stage == "motion back")  // at the second time gradients are added to those of the first
    return t.drawn * (8 + pose + 4 + 8 * t.parameters + flow * (pose + 12 * t.parameters));
  if (stage == "Adam") return 4 * (1 + 7) * t.parameters * t.moved;  // adam_refuse reads them, too
  return NAN;
}

}  // namespace gflow::bench
