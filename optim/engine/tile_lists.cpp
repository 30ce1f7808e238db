// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/tile_lists.hpp"

#include <algorithm>

#include "runtime/cl/chunks.hpp"
#include "runtime/primitives/sort.hpp"

namespace gflow {
namespace {

// One work-item per chunk, for devices with few fast cores.
class CountedLists : public TileLists {
 public:
  explicit CountedLists(Queue& queue)
      : program_(queue, "common.cl"),
        count_(program_, "tile_count"),
        columns_(program_, "tile_columns"),
        scatter_(program_, "tile_scatter"),
        scan_(queue) {}

  void build(Queue& queue, const Splats& splats, const DepthOrder& order, Tiles& tiles) override {
    const cl_uint count = cl_uint(tiles.count()), chunks = bin_chunks(queue, order.count);
    histogram_.ensure(queue, size_t(chunks) * count);
    totals_.ensure(queue, count);
    count_(queue, Range::over(chunks, 1), order.count, chunks, tiles.x, count, order.ids,
           splats.tile_boxes, histogram_);
    columns_(queue, Range::over(count), chunks, count, histogram_, totals_);
    scan_.exclusive(queue, totals_, tiles.tile_offsets, count);
    if (tiles.intersections == 0) return;
    scatter_(queue, Range::over(chunks, 1), order.count, chunks, tiles.x, count, order.ids,
             splats.tile_boxes, tiles.slot_offsets, tiles.tile_offsets, histogram_, tiles.isect_ids,
             tiles.isect_slots);
  }

 private:
  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_ushort>, Out<cl_uint>> count_;
  Kernel<cl_uint, cl_uint, Out<cl_uint>, Out<cl_uint>> columns_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_ushort>, In<cl_uint>, In<cl_uint>,
         Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      scatter_;
  Scan scan_;
  Buffer<cl_uint> histogram_{"tile histogram"};  // [chunks, tiles]
  Buffer<cl_uint> totals_{"tile totals"};        // [tiles]
};

int bits_of(cl_uint largest) {
  int bits = 0;
  for (; largest > 0; largest /= 2) ++bits;
  return bits;
}

// One work-item per intersection, for devices with thousands of work-items.
class SortedLists : public TileLists {
 public:
  explicit SortedLists(Queue& queue)
      : program_(queue, "common.cl"),
        in_order_(program_, "tiles_in_order"),
        pairs_(program_, "tile_pairs"),
        ids_(program_, "tile_ids"),
        starts_(program_, "tile_starts"),
        scan_(queue),
        sort_(queue) {}

  void build(Queue& queue, const Splats& splats, const DepthOrder& order, Tiles& tiles) override {
    const cl_uint count = cl_uint(tiles.count()), total = cl_uint(tiles.intersections);
    counts_.ensure(queue, order.count);
    keys_.ensure(queue, total);
    owners_.ensure(queue, total);
    tiles.tile_offsets.ensure(queue, count + 1);
    if (total > 0) {
      in_order_(queue, Range::over(order.count), order.count, order.ids, splats.tiles_touched,
                counts_);
      scan_.exclusive(queue, counts_, begins_, order.count);
      pairs_(queue, Range::over(total), total, order.count, tiles.x, begins_, order.ids,
             splats.tile_boxes, tiles.slot_offsets, keys_, tiles.isect_slots, owners_);
      sort_.sort(queue, keys_, tiles.isect_slots, total, bits_of(count - 1));
      ids_(queue, Range::over(total), total, tiles.isect_slots, owners_, tiles.isect_ids);
    }
    starts_(queue, Range::over(count + 1), count, total, keys_, tiles.tile_offsets);
  }

 private:
  Program program_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> in_order_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_ushort>, In<cl_uint>,
         Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      pairs_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> ids_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, Out<cl_uint>> starts_;
  Scan scan_;
  RadixSort sort_;
  Buffer<cl_uint> counts_{"tiles in depth order"}, begins_{"intersections in depth order"};
  Buffer<cl_uint> keys_{"tile keys"};      // [M]
  Buffer<cl_uint> owners_{"slot owners"};  // [M]
};

}  // namespace

std::unique_ptr<TileLists> tile_lists_for(Queue& queue) {
  if (chunk_group(queue) == 1) return std::make_unique<CountedLists>(queue);
  return std::make_unique<SortedLists>(queue);
}

cl_uint bin_chunks(const Queue& queue, size_t n) {
  const size_t wanted = queue.lanes > 1 ? 4 * queue.info.compute_units : 512;
  return cl_uint(std::clamp<size_t>(n / 256, 1, wanted));
}

}  // namespace gflow
