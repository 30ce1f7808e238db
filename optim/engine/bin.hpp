// SPDX-License-Identifier: Apache-2.0
// Splats into 16x16 tiles in depth order, with a mask of the touched cells for each intersection.
#pragma once
#include "optim/engine/project.hpp"
#include "runtime/sort.hpp"

namespace gflow {

// A tile t's splats are isect_ids[tile_offsets[t] .. tile_offsets[t + 1]), nearest first. The
// intersections of Gaussian i have the slots slot_offsets[i] .. slot_offsets[i + 1].
struct Tiles {
  cl_uint x = 0, y = 0;                          // tiles across and down
  size_t intersections = 0;                      // M
  Buffer<cl_uint> slot_offsets{"slot_offsets"};  // [N + 1]
  Buffer<cl_uint> tile_offsets{"tile_offsets"};  // [tiles + 1]
  Buffer<cl_uint> isect_ids{"isect_ids"};        // [M]
  Buffer<cl_uint> isect_slots{"isect_slots"};    // [M]
  Buffer<cl_ushort> masks{"masks"};              // [M] one bit a 4x4 cell
  size_t count() const { return size_t(x) * y; }
};

class Bin {
 public:
  Bin(Queue& queue, const EngineSettings& settings);
  // Counts what is seen, and the intersections. Does not wait.
  void start(Queue& queue, const Splats& splats, Tiles& tiles);
  // The rest, of the same splats. Waits for the counts alone: what was queued since start() may go
  // on. Error when there are 2^31 intersections or more, before anything is allocated.
  void build(Queue& queue, int width, int height, const Splats& splats, Tiles& tiles);

 private:
  Program bin_program_, mask_program_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, Out<cl_uint>> seen_count_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      seen_write_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_ushort>, Out<cl_uint>> tile_count_;
  Kernel<cl_uint, cl_uint, Out<cl_uint>, Out<cl_uint>> tile_columns_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_ushort>, In<cl_uint>, In<cl_uint>,
         Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      tile_scatter_;
  Kernel<cl_uint, In<float>, In<cl_uint>, In<cl_uint>, Out<cl_ushort>> cell_mask_;
  Scan seen_scan_, scan_;
  RadixSort sort_;
  cl_uint chunks_ = 0;                                                         // of all Gaussians
  Buffer<cl_uint> seen_counts_{"seen counts"}, seen_offsets_{"seen offsets"};  // [chunks (+ 1)]
  Buffer<cl_uint> keys_{"depth keys"}, order_{"depth order"};  // of the V that are seen
  Buffer<cl_uint> histogram_{"tile histogram"};                // [chunks, tiles]
  Buffer<cl_uint> totals_{"tile totals"};                      // [tiles]
};

}  // namespace gflow
