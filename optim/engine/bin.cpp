// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/bin.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace gflow {
namespace {

// Chunks of the depth order that are counted and scattered side by side: enough to fill the
// device, few enough that [chunks, tiles] counters stay small.
cl_uint chunks_on(const Queue& queue, size_t n) {
  const size_t wanted = queue.lanes > 1 ? 4 * queue.info.compute_units : 512;
  return cl_uint(std::clamp<size_t>(n / 256, 1, wanted));
}

// None as shipped, so that it is the program that others need, too.
Defines mask_defines(const EngineSettings& settings) {
  return with_more(settings.skip.masks ? Defines{} : Defines{{"CELL_MASKS", 0}}, settings);
}

Range chunk_range(const Queue& queue, cl_uint chunks) {
  return Range::over(chunks, queue.lanes > 1 ? 1 : 64);
}

}  // namespace

Bin::Bin(Queue& queue, const EngineSettings& settings)
    : bin_program_(queue, "common.cl"),
      mask_program_(queue, "common.cl", mask_defines(settings)),
      seen_count_(bin_program_, "seen_count"),
      seen_write_(bin_program_, "seen_write"),
      tile_count_(bin_program_, "tile_count"),
      tile_columns_(bin_program_, "tile_columns"),
      tile_scatter_(bin_program_, "tile_scatter"),
      cell_mask_(mask_program_, "cell_mask"),
      seen_scan_(queue),
      scan_(queue),
      sort_(queue) {}

void Bin::start(Queue& queue, const Splats& splats, Tiles& tiles) {
  const size_t n = splats.count;
  chunks_ = chunks_on(queue, n);
  seen_counts_.ensure(queue, chunks_);
  seen_count_(queue, chunk_range(queue, chunks_), cl_uint(n), chunks_, splats.tiles_touched,
              seen_counts_);
  seen_scan_.exclusive(queue, seen_counts_, seen_offsets_, chunks_);
  seen_scan_.fetch_total(queue);
  scan_.exclusive(queue, splats.tiles_touched, tiles.slot_offsets, n);
  scan_.fetch_total(queue);
}

void Bin::build(Queue& queue, int width, int height, const Splats& splats, Tiles& tiles) {
  tiles.x = cl_uint(width + TILE - 1) / TILE;
  tiles.y = cl_uint(height + TILE - 1) / TILE;
  const cl_uint count = cl_uint(tiles.count());
  const cl_uint seen = cl_uint(seen_scan_.fetched_total());
  const uint64_t total = scan_.fetched_total();
  if (total >= (uint64_t(1) << 31))
    throw Error(
        fmt::format("binning {} splats into {} tiles gives {} intersections, more than 2^31:"
                    " render a smaller picture or fewer, smaller Gaussians",
                    seen, count, total));
  keys_.ensure(queue, seen);
  order_.ensure(queue, seen);
  seen_write_(queue, chunk_range(queue, chunks_), cl_uint(splats.count), chunks_,
              splats.tiles_touched, splats.depth_keys, seen_offsets_, keys_, order_);
  sort_.sort(queue, keys_, order_, seen);

  const cl_uint chunks = chunks_on(queue, seen);
  histogram_.ensure(queue, size_t(chunks) * count);
  totals_.ensure(queue, count);
  tile_count_(queue, chunk_range(queue, chunks), seen, chunks, tiles.x, count, order_,
              splats.tile_boxes, histogram_);
  tile_columns_(queue, Range::over(count), chunks, count, histogram_, totals_);
  scan_.exclusive(queue, totals_, tiles.tile_offsets, count);

  tiles.intersections = size_t(total);
  tiles.isect_ids.ensure(queue, total);
  tiles.isect_slots.ensure(queue, total);
  tiles.masks.ensure(queue, total);
  if (total == 0) return;
  tile_scatter_(queue, chunk_range(queue, chunks), seen, chunks, tiles.x, count, order_,
                splats.tile_boxes, tiles.slot_offsets, tiles.tile_offsets, histogram_,
                tiles.isect_ids, tiles.isect_slots);
  cell_mask_(queue, Range::groups(count, queue.lanes > 1 ? 1 : 64), tiles.x, splats.records,
             tiles.tile_offsets, tiles.isect_ids, tiles.masks);
}

}  // namespace gflow
