// SPDX-License-Identifier: Apache-2.0
// Each tile's list of splats from all splats in depth order, as suits the device: counted by chunks
// (kernels/bin.cl) or sorted by tile (kernels/tile_sort.cl). Both make the same lists.
#pragma once
#include <memory>

#include "optim/engine/project.hpp"

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

// Splats that are seen, nearest first, ties by index.
struct DepthOrder {
  const Buffer<cl_uint>& ids;  // [V]
  cl_uint count;               // V
};

// Gives `tiles`, whose size, number of intersections and slot_offsets are known, its tile_offsets,
// isect_ids and isect_slots.
class TileLists {
 public:
  virtual ~TileLists() = default;
  virtual void build(Queue& queue, const Splats& splats, const DepthOrder& order, Tiles& tiles) = 0;
};

// What suits the queue's device.
std::unique_ptr<TileLists> tile_lists_for(Queue& queue);

// Pieces that n splats are cut into for counting: enough to fill the device, few enough that
// [chunks, tiles] counters stay small.
cl_uint bin_chunks(const Queue& queue, size_t n);

}  // namespace gflow
