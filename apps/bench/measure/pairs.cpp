// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/pairs.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/cl/kernel.hpp"

namespace gflow::bench {
namespace {

// Per tile, a bit mask of the cells with a pixel that has a nonzero gradient.
std::vector<cl_ushort> cells_that_ask(Queue& queue, const Images& images, const ImageGradients& v,
                                      bool flow) {
  const size_t width = size_t(images.width), pixels = width * size_t(images.height);
  const size_t across = (width + TILE - 1) / TILE;
  std::vector<cl_ushort> cells(across * ((size_t(images.height) + TILE - 1) / TILE), 0);
  const auto look = [&](const Buffer<float>& planes, size_t count) {
    const std::vector<float> values = planes.read(queue);
    for (size_t i = 0; i < count * pixels; ++i) {
      if (values[i] == 0) continue;
      const size_t y = i % pixels / width, x = i % width;
      const size_t cell = y % TILE / CELL * (TILE / CELL) + x % TILE / CELL;
      cells[y / TILE * across + x / TILE] |= cl_ushort(1u << cell);
    }
  };
  look(v.v_rgb, 3);
  look(v.v_alpha, 1);
  if (flow) look(v.v_flow, 2);
  return cells;
}

double sum(const std::vector<cl_uint>& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0.0);
}

// Counts pairs in the tile lists, each from its start to `ends`, in the given cells.
class Walk {
 public:
  Walk(Queue& queue, const Engine& engine, const EngineSettings& settings)
      : queue_(queue),
        engine_(engine),
        program_(queue, "checks/count_pairs.cl",
                 {{"EXCLUDE", int(settings.stop == StopRule::exclude)}}),
        count_(program_, "count_pairs"),
        width_(size_t(engine.images().width)),
        height_(size_t(engine.images().height)) {
    for (Buffer<cl_uint>* plane : {&listed, &masked, &blended, &open_})
      plane->ensure(queue, width_ * height_);
  }

  void operator()(const std::vector<cl_uint>& ends, const std::vector<cl_ushort>& cells) {
    const Tiles& tiles = engine_.tiles();
    ends_.ensure(queue_, ends.size());
    ends_.write(queue_, ends);
    cells_.ensure(queue_, cells.size());
    cells_.write(queue_, cells);
    count_(queue_, Range::grid(width_, height_), cl_int(width_), cl_int(height_),
           engine_.splats().records, tiles.tile_offsets, tiles.isect_ids, tiles.masks, ends_,
           cells_, listed, masked, blended, open_);
  }

  // Where the kernels stop: once all given cells are saturated, checked after each `batch` of
  // splats; at most `ends`.
  std::vector<cl_uint> stops(const std::vector<cl_uint>& ends, const std::vector<cl_ushort>& cells,
                             cl_uint batch) const {
    const std::vector<cl_uint> open = open_.read(queue_);
    const size_t across = (width_ + TILE - 1) / TILE;
    std::vector<cl_uint> most(ends.size(), 0);
    for (size_t y = 0; y < height_; ++y)
      for (size_t x = 0; x < width_; ++x) {
        const size_t tile = y / TILE * across + x / TILE;
        const size_t cell = y % TILE / CELL * (TILE / CELL) + x % TILE / CELL;
        if (cells[tile] >> cell & 1) most[tile] = std::max(most[tile], open[y * width_ + x]);
      }
    for (size_t tile = 0; tile < most.size(); ++tile)
      most[tile] = std::min(ends[tile], (most[tile] + batch - 1) / batch * batch);
    return most;
  }

  Buffer<cl_uint> listed{"listed pairs"}, masked{"masked pairs"}, blended{"blended pairs"};

 private:
  Queue& queue_;
  const Engine& engine_;
  Program program_;
  Kernel<cl_int, cl_int, In<float>, In<cl_uint>, In<cl_uint>, In<cl_ushort>, In<cl_uint>,
         In<cl_ushort>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      count_;
  size_t width_, height_;
  Buffer<cl_uint> open_{"looked at until full"}, ends_{"ends of lists"};
  Buffer<cl_ushort> cells_{"cells looked at"};
};

}  // namespace

Pairs count_pairs(Queue& queue, const Engine& engine, const EngineSettings& settings,
                  const ImageGradients* v, bool flow) {
  const std::vector<cl_uint> offsets = engine.tiles().tile_offsets.read(queue);
  std::vector<cl_uint> whole(engine.tiles().count());
  for (size_t tile = 0; tile < whole.size(); ++tile)
    whole[tile] = offsets[tile + 1] - offsets[tile];
  const std::vector<cl_ushort> all(whole.size(), 0xffff);
  const bool stops = settings.skip.saturated;
  const std::vector<cl_ushort> asking =
      v && settings.skip.zero_gradients ? cells_that_ask(queue, engine.images(), *v, flow) : all;

  Walk walk(queue, engine, settings);
  walk(whole, all);
  Pairs pairs;
  pairs.listed = sum(walk.listed.read(queue));
  // splat_fwd checks for saturation periodically; splat_bwd starts where the last pixel
  // saturated.
  const std::vector<cl_uint> there =
      stops ? walk.stops(whole, all, queue.lanes == 1 ? 64 : 32) : whole;
  const std::vector<cl_uint> back = stops ? walk.stops(whole, asking, 1) : whole;
  walk(there, all);
  pairs.masked = sum(walk.masked.read(queue));
  pairs.blended = sum(walk.blended.read(queue));
  walk(back, asking);
  pairs.back = sum(walk.masked.read(queue));
  return pairs;
}

size_t tiles_asking_flow(Queue& queue, const Images& images, const ImageGradients& v) {
  const size_t width = size_t(images.width), pixels = width * size_t(images.height);
  const size_t across = (width + TILE - 1) / TILE;
  std::vector<bool> asks(across * ((size_t(images.height) + TILE - 1) / TILE), false);
  const std::vector<float> v_flow = v.v_flow.read(queue);
  for (size_t i = 0; i < 2 * pixels; ++i)
    if (v_flow[i] != 0) asks[i % pixels / width / TILE * across + i % width / TILE] = true;
  return size_t(std::count(asks.begin(), asks.end(), true));
}

// Forward: exponent 8, exp2 13, cut-off, weight and transmittance 5, colour 6; flow 12, depth 2.
// Backward repeats 26 of them, and adds 26 for the gradients of colour and alpha, 28 for flow, 4
// for depth.
double forward_flops(Channels c) { return 32 + (c.flow ? 12 : 0) + (c.depth ? 2 : 0); }
double backward_flops(Channels c) { return 52 + (c.flow ? 28 : 0) + (c.depth ? 4 : 0); }

double bytes_of(const Touched& t) {
  return 6 * 4 * t.parameters * t.moved + 900 * t.drawn + 310 * t.intersections +
         (107 + t.truth_bytes) * t.pixels;
}

double bytes_of_stage(const std::string& stage, const Touched& t, Channels c) {
  const double pose = 12 + 36, record = 64, flow = c.flow;  // mean and factor; splat
  const double planes = 4 * (6 + 2 * flow + c.depth);       // images of splat.cl
  if (stage == "motion") return (1 + flow) * t.drawn * (4 * t.parameters + pose + 4);
  if (stage == "project") return t.drawn * (pose + 4 + record / 2 + 8 + 4 + 4);
  if (stage == "bin")  // keys written; three sort passes; counting and scattering per tile
    return t.drawn * (12 + 3 * (4 + 16) + 12 + 16) + 8 * t.intersections;
  if (stage == "mask") return t.intersections * (4 + record / 2 + 2);
  if (stage == "transport") return t.drawn * (4 + 12 + 2 * pose * flow + 36);
  if (stage == "splat") return t.intersections * (4 + 2 + record) + t.pixels * planes;
  if (stage == "backward")
    return t.intersections * (4 + 4 + 2 + 2 * record) +
           t.pixels * (planes + 4 * (4 + 2 * flow + c.depth));
  if (stage == "gather") return t.intersections * record + t.drawn * (4 + record);
  if (stage == "project back")
    return t.drawn * (4 + 4 + record + (1 + flow) * 2 * pose + 4 + 12 + 8);
  if (stage == "motion back")  // gradients at t2 are added to those at t1
    return t.drawn * (8 + pose + 4 + 8 * t.parameters + flow * (pose + 12 * t.parameters));
  if (stage == "Adam")
    return 4 * 6 * t.parameters * t.moved;  // gradients twice, values, second moments
  return NAN;
}

}  // namespace gflow::bench
