// SPDX-License-Identifier: Apache-2.0
// Tiles of splats to images, and image gradients to 16 moments a Gaussian.
#pragma once
#include <array>

#include "optim/engine/bin.hpp"

namespace gflow {

class Splatting {
 public:
  Splatting(Queue& queue, const EngineSettings& settings, Channels channels);
  // Which tiles of a picture have flow, [tiles] 0 or 1 for forward(): those with a weight in
  // flow_tiles (nullptr: all) and a splat below `moving`.
  const Buffer<cl_uchar>& tiles_with_flow(Queue& queue, const Buffer<float>* flow_tiles,
                                          size_t moving, const Tiles& tiles);
  // images.width and height are set by the caller. Of a picture shared between one with flow and
  // one without, each draws the tiles that are its own by with_flow.
  void forward(Queue& queue, const std::array<float, 3>& background, const Splats& splats,
               const Tiles& tiles, Images& images, const Buffer<cl_uchar>* with_flow = nullptr);
  // partials [M, 16]; moments [N, 16], undefined for Gaussians that were not seen. All of v is read
  // that the channels have, v_alpha always. In two halves: first all tiles, or with `shared` those
  // that ask for flow, or none, as the channels have it; then the sums over them.
  void backward(Queue& queue, const Splats& splats, const Tiles& tiles, const Images& images,
                const ImageGradients& v, Buffer<float>& partials, bool shared = false);
  void gather(Queue& queue, const Splats& splats, const Tiles& tiles, const Buffer<float>& partials,
              Buffer<float>& moments);

 private:
  int lanes_;
  EngineSettings settings_;
  Channels channels_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_int, In<float>, In<cl_uint>, In<cl_uint>, Out<cl_uchar>>
      tiles_with_flow_;
  Kernel<cl_int, cl_int, cl_int, In<cl_uchar>, cl_float, cl_float, cl_float, In<float>, In<cl_uint>,
         In<cl_uint>, In<cl_ushort>, Out<float>, Out<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<cl_int>>
      splat_fwd_;
  Kernel<cl_int, cl_int, cl_int, In<float>, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<cl_ushort>,
         cl_float, cl_float, cl_float, In<float>, In<float>, In<float>, In<float>, In<cl_int>,
         In<float>, In<float>, In<float>, In<float>, Out<float>>
      splat_bwd_;
  Kernel<cl_uint, In<cl_uint>, In<float>, Out<float>> gather_;
  Buffer<float> no_choice_{"no choice of tiles"};
  Buffer<cl_uchar> with_flow_{"tiles with flow"}, no_tiles_{"no tiles with flow"};
};

}  // namespace gflow
