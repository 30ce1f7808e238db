// SPDX-License-Identifier: Apache-2.0
// Tiles of splats to images, and image gradients to 16 moments per Gaussian.
#pragma once
#include <array>

#include "optim/engine/bin.hpp"

namespace gflow {

class Splatting {
 public:
  Splatting(Queue& queue, const EngineSettings& settings, Channels channels);
  // Which tiles of an image have flow, [tiles] 0 or 1 for forward(): those that are chosen by
  // flow_tiles (nullptr: all) and contain a splat of a row below `moving`.
  const Buffer<cl_uchar>& tiles_with_flow(Queue& queue, const Buffer<float>* flow_tiles,
                                          size_t moving, const Tiles& tiles);
  // The caller sets images.width and height. With with_flow, two Splattings share an image: the one
  // with the flow channel renders the tiles with flow, the other one the rest.
  void forward(Queue& queue, const std::array<float, 3>& background, const Splats& splats,
               const Tiles& tiles, Images& images, const Buffer<cl_uchar>* with_flow = nullptr);
  // The backward pass in two halves. backward(): partials [M, 16] per intersection, from the
  // gradients v of all channels and always v_alpha. With `shared` it covers only the tiles with
  // nonzero v_flow if it has the flow channel, else only the others. gather(): moments [N, 16], the
  // sums per Gaussian, undefined for Gaussians that were not visible.
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
