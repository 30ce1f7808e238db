// SPDX-License-Identifier: Apache-2.0
// Gaussians to splats: projection at t1 and t2, whitening, transport; and back.
#pragma once
#include <limits>
#include <memory>

#include "optim/engine/gaussians.hpp"
#include "optim/engine/settings.hpp"

namespace gflow {

// Splats and where they lie, an entry a Gaussian. tiles_touched = 0: not seen.
// Of rows that are not seen only that, and flow_touched = 0 where tiles were chosen, is defined.
struct Splats {
  size_t count = 0;                                // N
  Buffer<float> records{"splats"};                 // [N, 16] shared/pixel.h
  Buffer<cl_ushort> tile_boxes{"tile_boxes"};      // [N, 4] first x, first y, last x, last y
  Buffer<cl_uint> tiles_touched{"tiles_touched"};  // [N]
  Buffer<cl_uint> depth_keys{"depth_keys"};        // [N] monotone in depth
  Buffer<cl_uint> flow_touched{"flow_touched"};    // [N] 1: touches one of View::flow_tiles
  bool chosen = false;                             // there were such tiles, else it is undefined
  // [N] above 0: seen, and in a tile that has flow. Only of these is the pose at t2 looked at.
  const Buffer<cl_uint>& rows_with_flow() const { return chosen ? flow_touched : tiles_touched; }
};

// What is looked at: the camera at t1 and, for flow, at t2 (the same one when it stands still).
constexpr size_t all_rows = std::numeric_limits<size_t>::max();

struct View {
  PinholeCamera camera, camera_t2;
  // The entries from here on stand still in it: they are at t2 as at t1, before the same camera.
  // They show no flow and what they ask of their place at t2 stays theirs (v_means_t2): it is not a
  // part of v_means. Nothing else of t2 is read or written.
  size_t moving = all_rows;
  // Which tiles have flow: [tiles], row by row, 0 for those that have none; nullptr: all have. A
  // Gaussian that touches none of them needs no pose at t2. To be kept until the backward pass,
  // whose v_flow must be 0 in the tiles without flow.
  const Buffer<float>* flow_tiles = nullptr;
};

class Project {
 public:
  Project(Queue& queue, const EngineSettings& settings, Channels channels);
  // Splats without colour and flow; decides what is seen.
  void forward(Queue& queue, const View& view, const GaussiansAt& at_t1, Splats& splats);
  // Adds colour for what is seen and, with flow, motion for rows_with_flow(); nothing else of
  // colors and at_t2 is read.
  // Without flow at_t1 may be passed for at_t2.
  void complete(Queue& queue, const View& view, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const Buffer<float>& colors, Splats& splats);
  // moments [N, 16] are what Splatting::backward collected.
  void backward(Queue& queue, const View& view, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const Splats& splats, const Buffer<float>& moments, GaussianGradients& gradients);

 private:
  Program program_;
  Kernel<cl_uint, PinholeCamera, cl_int, In<float>, In<float>, In<float>, In<float>, Out<float>,
         Out<cl_ushort>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      project_fwd_;
  Kernel<cl_uint, cl_uint, PinholeCamera, PinholeCamera, In<float>, In<float>, In<float>, In<float>,
         In<float>, In<cl_uint>, In<cl_uint>, Out<float>>
      transport_fwd_;
  Kernel<cl_uint, cl_uint, PinholeCamera, PinholeCamera, In<float>, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<cl_uint>, In<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>, Out<float>>
      project_bwd_;
};

}  // namespace gflow
