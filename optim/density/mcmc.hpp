// SPDX-License-Identifier: Apache-2.0
// Density strategy "mcmc" (Kheradmand et al. 2024, "3D Gaussian Splatting as Markov Chain Monte
// Carlo"): training as sampling. No thresholds: dead Gaussians move to live ones drawn by opacity,
// the number grows by a share a round up to the cap, noise on the means lets faint ones search, and
// opacity and size cost a little, so that what is not needed dies. Kernels: kernels/mcmc.cl.
//
// Where this differs from the authors' program: relocation and growth draw together, in one round,
// and from the whole line of opacities in equal parts; those that come to one place are moved apart
// by half a size, because equal ones learn alike for long (n3v-baton, 3000 steps, seed 0: 35.1 dB,
// without 33.8, by a whole size 34.8; without noise, with any growth, 33.5 to 33.8); noise reaches
// a Gaussian, as Adam does, in the steps that see it; what lives wholly outside of the video counts
// as dead.
#pragma once
#include "optim/density/density.hpp"
#include "optim/density/rows.hpp"
#include "runtime/primitives/scan.hpp"

namespace gflow {

class McmcDensity : public Density {
 public:
  explicit McmcDensity(Queue& queue);

  void add_gradients(Queue& queue, Parameters& parameters, const DensityRule& rule) override;
  bool needs_all_posed() const override { return true; }  // its noise is for all that live
  void after_step(Queue& queue, Parameters& parameters, const GaussiansAt& drawn,
                  const DensityRule& rule, const DensityStep& step) override;
  // A row that moves or is moved to starts with zero moments and step counts. Waits twice. The
  // number never shrinks; where all are dead nothing changes. Seed: of the draws.
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
