// SPDX-License-Identifier: Apache-2.0
// Assigns splats to 16x16 tiles in depth order, with a mask of the touched cells per intersection.
#pragma once
#include "optim/engine/tile_lists.hpp"
#include "runtime/primitives/sort.hpp"

namespace gflow {

class Bin {
 public:
  Bin(Queue& queue, const EngineSettings& settings);
  // Starts counting visible Gaussians and intersections. Does not wait.
  void start(Queue& queue, const Splats& splats, Tiles& tiles);
  // Builds the tile lists of the same splats. Waits only for the counts; work queued after start()
  // may continue. Error, before anything is allocated, if there are 2^31 or more intersections.
  void build(Queue& queue, int width, int height, const Splats& splats, Tiles& tiles);

 private:
  Program bin_program_, mask_program_;
  Kernel<cl_uint, In<cl_uint>, Out<cl_uint>> seen_count_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>> seen_write_;
  Kernel<cl_uint, In<float>, In<cl_uint>, In<cl_uint>, Out<cl_ushort>> cell_mask_;
  Scan seen_scan_, scan_;
  RadixSort sort_;
  std::unique_ptr<TileLists> lists_;
  cl_uint chunks_ = 0;                                                         // of all Gaussians
  Buffer<cl_uint> seen_counts_{"seen counts"}, seen_offsets_{"seen offsets"};  // [chunks (+ 1)]
  Buffer<cl_uint> keys_{"depth keys"}, order_{"depth order"};  // [V] visible Gaussians
};

}  // namespace gflow
