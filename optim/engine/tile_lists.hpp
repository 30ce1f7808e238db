// SPDX-License-Identifier: Apache-2.0
// Lists of splats per tile, from all splats in depth order. Two methods with the same result:
// counting by chunks (kernels/engine/bin.cl), or sorting by tile (kernels/engine/tile_sort.cl).
#pragma once
#include <memory>

#include "optim/engine/project.hpp"

namespace gflow {

// Tile t contains the splats isect_ids[tile_offsets[t] .. tile_offsets[t + 1]), nearest first. The
// intersections of Gaussian i have the slots slot_offsets[i] .. slot_offsets[i + 1].
struct Tiles {
  cl_uint x = 0, y = 0;                          // tiles across and down
  size_t intersections = 0;                      // M
  Buffer<cl_uint> slot_offsets{"slot_offsets"};  // [N + 1]
  Buffer<cl_uint> tile_offsets{"tile_offsets"};  // [tiles + 1]
  Buffer<cl_uint> isect_ids{"isect_ids"};        // [M]
  Buffer<cl_uint> isect_slots{"isect_slots"};    // [M]
  Buffer<cl_ushort> masks{"masks"};              // [M]; one bit per 4x4 cell
  size_t count() const { return size_t(x) * y; }
};

// Visible splats, nearest first, ties by index.
struct DepthOrder {
  const Buffer<cl_uint>& ids;  // [V]
  cl_uint count;               // V
};

// Fills tile_offsets, isect_ids and isect_slots of `tiles`, whose size, number of intersections and
// slot_offsets are set.
class TileLists {
 public:
  virtual ~TileLists() = default;
  virtual void build(Queue& queue, const Splats& splats, const DepthOrder& order, Tiles& tiles) = 0;
};

// The implementation that suits the queue's device.
std::unique_ptr<TileLists> tile_lists_for(Queue& queue);

// Number of chunks for counting n splats: enough to occupy the device, few enough that the counters
// [chunks, tiles] stay small.
cl_uint bin_chunks(const Queue& queue, size_t n);

}  // namespace gflow
