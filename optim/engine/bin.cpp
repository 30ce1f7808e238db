// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/bin.hpp"

#include <fmt/format.h>

#include "runtime/cl/chunks.hpp"

namespace gflow {
namespace {

// Without defines if masks are on, so that the program is shared with other users of common.cl.
Defines mask_defines(const EngineSettings& settings) {
  return with_more(settings.skip.masks ? Defines{} : Defines{{"CELL_MASKS", 0}}, settings);
}

// One work-group per chunk.
Range groups_of(const Queue& queue, cl_uint chunks) {
  return Range::groups(chunks, size_t(chunk_group(queue)));
}

}  // namespace

Bin::Bin(Queue& queue, const EngineSettings& settings)
    : bin_program_(queue, "common.cl"),
      mask_program_(queue, "common.cl", mask_defines(settings)),
      seen_count_(bin_program_, "seen_count"),
      seen_write_(bin_program_, "seen_write"),
      cell_mask_(mask_program_, "cell_mask"),
      seen_scan_(queue),
      scan_(queue),
      sort_(queue),
      lists_(tile_lists_for(queue)) {}

void Bin::start(Queue& queue, const Splats& splats, Tiles& tiles) {
  const size_t n = splats.count;
  chunks_ = bin_chunks(queue, n);
  seen_counts_.ensure(queue, chunks_);
  seen_count_(queue, groups_of(queue, chunks_), cl_uint(n), splats.tiles_touched, seen_counts_);
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
        fmt::format("binning {} splats into {} tiles gives {} intersections, more than 2^31: "
                    "render a smaller image or fewer, smaller Gaussians",
                    seen, count, total));
  keys_.ensure(queue, seen);
  order_.ensure(queue, seen);
  seen_write_(queue, groups_of(queue, chunks_), cl_uint(splats.count), splats.tiles_touched,
              splats.depth_keys, seen_offsets_, keys_, order_);
  sort_.sort(queue, keys_, order_, seen);

  tiles.intersections = size_t(total);
  tiles.isect_ids.ensure(queue, total);
  tiles.isect_slots.ensure(queue, total);
  tiles.masks.ensure(queue, total);
  lists_->build(queue, splats, {order_, seen}, tiles);
  if (total == 0) return;
  cell_mask_(queue, Range::groups(count, queue.lanes > 1 ? 1 : 64), tiles.x, splats.records,
             tiles.tile_offsets, tiles.isect_ids, tiles.masks);
}

}  // namespace gflow
