// SPDX-License-Identifier: Apache-2.0
// Density strategy "adc" (adaptive density control, Kerbl et al. 2023). Gaussians with large
// gradients are split or cloned; faint, huge and never visible ones are removed. At the cap the
// largest gradients go first. Kernels: kernels/density/adc.cl.
#pragma once
#include "optim/density/density.hpp"
#include "optim/density/rows.hpp"
#include "runtime/primitives/sort.hpp"

namespace gflow {

class AdcDensity : public Density {
 public:
  explicit AdcDensity(Queue& queue);

  void see(Queue& queue, const Parameters& parameters, const DensityView& view) override;
  // Limits all opacities to twice the minimum when a reset is due.
  void after_step(Queue& queue, Parameters& parameters, const GaussiansAt& drawn,
                  const DensityRule& rule, const DensityStep& step) override;
  // Uses the gradients accumulated since the last call, and clears them. Children start with zero
  // moments and step counts. seed: of the children's positions. Waits once.
  void refine(Queue& queue, Parameters& parameters, Motion& motion, const DensityRule& rule,
              uint32_t seed) override;
  void reorder(Queue& queue, const Buffer<cl_uint>& source) override;
  // The accumulated gradients: density/pull and density/views [N].
  void save_state(Queue& queue, Arrays& arrays) const override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  void forget(Queue& queue, size_t count);

  Program program_;
  Kernel<cl_uint, cl_float, cl_float, cl_uint, In<cl_uint>, In<cl_uint>, In<float>, Out<float>,
         Out<float>>
      adc_accumulate_;
  Kernel<cl_uint, cl_float, cl_float, cl_float, cl_float, cl_float, In<float>, In<float>, In<float>,
         In<float>, In<float>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      adc_rank_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> adc_grow_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>> adc_sources_;
  Kernel<cl_uint, cl_float, Out<float>, Out<float>> adc_reset_;
  Kernel<cl_uint, In<cl_uint>, In<float>, In<float>, Out<float>, Out<float>> adc_reorder_;
  RowMover rows_;
  Scan scan_;
  RadixSort sort_;
  // [N] since the last round: sums of the norms of the gradient of the projected mean, and the
  // number of views.
  Buffer<float> grad2d_{"grad2d"}, views_{"views"};
  Buffer<cl_uint> copies_{"copies"}, keys_{"density keys"}, order_{"density order"};
  Buffer<cl_uint> offsets_{"offsets"}, source_{"source"}, child_{"child"};
};

}  // namespace gflow
