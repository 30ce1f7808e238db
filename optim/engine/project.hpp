// SPDX-License-Identifier: Apache-2.0
// Gaussians to splats: projection at t1 and t2, whitening, transport; and the backward pass.
#pragma once
#include <limits>
#include <memory>

#include "optim/engine/gaussians.hpp"
#include "optim/engine/settings.hpp"

namespace gflow {

// Splats and their tiles, one entry per Gaussian. tiles_touched = 0 means not visible. For such a
// row only tiles_touched and, if flow tiles were chosen, flow_touched = 0 are defined.
struct Splats {
  size_t count = 0;                                // N
  Buffer<float> records{"splats"};                 // [N, 16]; see shared/pixel.h
  Buffer<cl_ushort> tile_boxes{"tile_boxes"};      // [N, 4]; first x, first y, last x, last y
  Buffer<cl_uint> tiles_touched{"tiles_touched"};  // [N]
  Buffer<cl_uint> depth_keys{"depth_keys"};        // [N]; monotone in depth
  Buffer<cl_uint> flow_touched{"flow_touched"};    // [N]; 1: touches one of View::flow_tiles
  bool chosen = false;  // whether flow tiles were chosen; else flow_touched is undefined
  // [N]; > 0: visible and in a tile with flow. The pose at t2 is read only for these rows.
  const Buffer<cl_uint>& rows_with_flow() const { return chosen ? flow_touched : tiles_touched; }
};

// A view: the camera at t1 and, for flow, at t2 (the same if the camera is static).
constexpr size_t all_rows = std::numeric_limits<size_t>::max();

struct View {
  PinholeCamera camera, camera_t2;
  // Rows from here on are static in this view: same pose and same camera at t2 as at t1. They have
  // no flow and nothing of t2 is read for them. Their gradient by the mean at t2 goes to v_means_t2
  // only and is not added to v_means.
  size_t moving = all_rows;
  // Which tiles have flow: [tiles], row by row, 0 for tiles without; nullptr: all. The pose at t2
  // of a Gaussian that touches no such tile is not needed. Must stay valid until the backward pass,
  // whose v_flow must be 0 in tiles without flow.
  const Buffer<float>* flow_tiles = nullptr;
};

class Project {
 public:
  Project(Queue& queue, const EngineSettings& settings, Channels channels);
  // Splats without colour and flow; decides which Gaussians are visible.
  void forward(Queue& queue, const View& view, const GaussiansAt& at_t1, Splats& splats);
  // Adds colours to visible splats and, with flow, motion to rows_with_flow(). Other rows of colors
  // and at_t2 are not read. Without flow at_t1 may be passed for at_t2.
  void complete(Queue& queue, const View& view, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const Buffer<float>& colors, Splats& splats);
  // moments [N, 16] are the result of Splatting::gather.
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
