// SPDX-License-Identifier: Apache-2.0
// Gaussians to splats: projection at t1 and t2, whitening, transport; and back.
#pragma once
#include <limits>
#include <memory>

#include "optim/engine/gaussians.hpp"
#include "optim/engine/settings.hpp"

namespace gflow {

// Splats and where they lie, an entry a Gaussian. tiles_touched = 0: not seen.
// Of rows that are not seen only tiles_touched = 0 and flow_touched = 0 are defined.
struct Splats {
  size_t count = 0;                                // N
  Buffer<float> records{"splats"};                 // [N, 16] shared/pixel.h
  Buffer<cl_ushort> tile_boxes{"tile_boxes"};      // [N, 4] first x, first y, last x, last y
  Buffer<cl_uint> tiles_touched{"tiles_touched"};  // [N]
  Buffer<cl_uint> depth_keys{"depth_keys"};        // [N] monotone in depth
  Buffer<cl_uint> flow_touched{"flow_touched"};    // [N] with View::flow_tiles: 1 touches one
  bool chosen = false;                             // there are flow_touched
  // Who has a second time, above 0: the others' pose there matters to nobody.
  const Buffer<cl_uint>& with_flow() const { return chosen ? flow_touched : tiles_touched; }
};

// What is looked at: the camera at t1 and, for flow, at t2 (the same one when it stands still).
constexpr size_t all_rows = std::numeric_limits<size_t>::max();

struct View {
  PinholeCamera camera, camera_t2;
  // The rows from here on stand still in it: they are at t2 as at t1, before the same camera. They
  // show no flow and what they ask of their place at t2 stays theirs (v_means_t2): it is not a part
  // of v_means. Nothing else of t2 is read or written.
  size_t moving = all_rows;
  // [tiles], row by row; 0: no flow is asked of the tile, which shows none; who touches no others
  // has none. Of all tiles without it. It must live until the backward pass, of which v_flow must
  // be 0 in those tiles.
  const Buffer<float>* flow_tiles = nullptr;
};

class Project {
 public:
  Project(Queue& queue, const EngineSettings& settings, Channels channels);
  // Splats without colour and flow; decides what is seen.
  void forward(Queue& queue, const View& view, const GaussiansAt& at_t1, Splats& splats);
  // Adds colour and, with flow, motion for what is seen; nothing else of colors and at_t2 is read.
  // Without flow at_t1 may be passed for at_t2.
  void complete(Queue& queue, const View& view, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const Buffer<float>& colors, Splats& splats);
  // moments [N, 16] are what Splatting::backward collected.
  void backward(Queue& queue, const View& view, const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                const Splats& splats, const Buffer<float>& moments, GaussianGradients& gradients);

 private:
  Program program_;
  Kernel<cl_uint, PinholeCamera, In<float>, In<float>, In<float>, Out<float>, Out<cl_ushort>,
         Out<cl_uint>, Out<cl_uint>>
      project_fwd_;
  Kernel<cl_uint, cl_uint, In<float>, In<cl_ushort>, In<cl_uint>, Out<cl_uint>> flow_rows_;
  Kernel<cl_uint, cl_uint, PinholeCamera, PinholeCamera, In<float>, In<float>, In<float>, In<float>,
         In<float>, In<cl_uint>, In<cl_uint>, Out<float>>
      transport_fwd_;
  Kernel<cl_uint, cl_uint, PinholeCamera, PinholeCamera, In<float>, In<float>, In<float>, In<float>,
         In<float>, In<float>, In<cl_uint>, In<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>, Out<float>, Out<float>>
      project_bwd_;
};

}  // namespace gflow
