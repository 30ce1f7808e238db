// SPDX-License-Identifier: Apache-2.0
// Density strategy "mcmc" (Kheradmand et al. 2024, "3D Gaussian Splatting as Markov Chain Monte
// Carlo"): training as sampling, without gradient thresholds. Dead Gaussians move to live ones
// drawn by opacity. The number grows by a share per round up to the cap. Noise on the means lets
// faint Gaussians explore. Opacity and size have a small cost, so that unneeded Gaussians die.
// Kernels: kernels/density/mcmc.cl.
//
// Differences from the authors' program: relocation and growth draw together, once per round, by
// stratified sampling over the opacities. Copies of one Gaussian are moved apart by half its size,
// because equal copies receive equal gradients for long; this gives the best PSNR (0 and a whole
// size are worse). Like Adam, noise reaches a Gaussian only in steps that see it. Gaussians
// entirely outside the video count as dead.
#pragma once
#include "optim/density/density.hpp"
#include "optim/density/rows.hpp"
#include "runtime/primitives/scan.hpp"

namespace gflow {

class McmcDensity : public Density {
 public:
  explicit McmcDensity(Queue& queue);

  void add_gradients(Queue& queue, Parameters& parameters, const DensityRule& rule) override;
  // Noise also moves Gaussians outside the last image.
  bool needs_all_posed() const override { return true; }
  void after_step(Queue& queue, Parameters& parameters, const GaussiansAt& drawn,
                  const DensityRule& rule, const DensityStep& step) override;
  // Rows that move or are moved to start with zero moments and step counts. The number never
  // shrinks; if all Gaussians are dead nothing changes. seed: of the draws. Waits twice.
  void refine(Queue& queue, Parameters& parameters, Motion& motion, const DensityRule& rule,
              uint32_t seed) override;

 private:
  Program program_;
  Kernel<cl_uint, cl_float, cl_float, cl_float, cl_float, In<float>, In<float>, In<float>,
         Out<cl_uint>, Out<cl_uint>>
      mcmc_weigh_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, Out<cl_uint>> mcmc_draw_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>,
         Out<cl_uint>>
      mcmc_sources_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, In<cl_uint>, In<float>, Out<float>, Out<float>,
         Out<float>>
      mcmc_share_;
  Kernel<cl_uint, cl_float, cl_float, In<cl_uint>, In<float>, In<float>, Out<float>, Out<float>>
      mcmc_shrink_;
  Kernel<cl_uint, cl_uint, cl_float, cl_float, In<cl_uint>, In<float>, In<float>, In<float>,
         Out<float>>
      mcmc_noise_;
  RowMover rows_;
  Scan scan_;
  Buffer<cl_uint> dead_{"dead"}, dead_offsets_{"dead offsets"};
  Buffer<cl_uint> weights_{"weights"}, offsets_{"weight offsets"}, drawn_{"drawn"};
  Buffer<cl_uint> source_{"source"}, child_{"child"};
};

}  // namespace gflow
