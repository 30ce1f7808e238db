// SPDX-License-Identifier: Apache-2.0
// The static/dynamic split. Gaussians that need no motion lose their motion parameters and the
// optimiser state of these, and get them back when their gradients call for motion. For every
// motion model whose Gaussians have their own motion. Kernels: kernels/density/static_detection.cl.
//
// Gaussians become dynamic at initialisation, by density control (RowMover), or by the gradients
// accumulated here. A round makes those static that, after a trial of some steps, stay near their
// mean pose.
#pragma once
#include "optim/density/rows.hpp"
#include "optim/formats/npz.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

struct StaticRule {
  // Largest distance of a static Gaussian from its mean pose (kernels/shared/static_detection.h).
  float most = 0.05f;
  // A static Gaussian wakes when its summed gradient exceeds this multiple of the expected noise;
  // 0: never.
  float wake = 5;
  unsigned trial = 50;  // optimiser steps a Gaussian needs before it may become static
  float duration = 1;   // length of the video [model time]
  int moments = 2;      // times at which poses are compared, evenly from 0 to duration; >= 2
};

class StaticDetection {
 public:
  explicit StaticDetection(Queue& queue);

  // After a view: accumulates its gradients by the means at t and, with flow, at t2 (model times).
  // `stood_still`: static Gaussians kept their pose between them (View::moving).
  void see(Queue& queue, const Parameters& parameters, const ViewRows& rows,
           const Buffer<cl_uint>& tiles_touched, float t, const Buffer<float>& v_means,
           const float* t2, const Buffer<float>& v_means_t2, bool stood_still);

  // A round; clears the accumulated gradients. Gaussians that become static change by at most 0.74
  // rule.most of their opacity at each compared time. Returns the former row of each new row. Woken
  // Gaussians start with zero moments and step counts; all others keep theirs. Waits. If memory
  // runs out it throws, and the parameters are unchanged.
  const Buffer<cl_uint>& refine(Queue& queue, Parameters& parameters, Motion& motion,
                                const StaticRule& rule);
  // After density control has moved the rows.
  void forget() { sums_known_ = false; }

  // State for a checkpoint: rest/pulls [static Gaussians, 4].
  void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays) const;
  void load_state(Queue& queue, const Parameters& parameters, const Arrays& arrays,
                  const std::string& path);

 private:
  void start_sums(Queue& queue, const Parameters& parameters);

  Program program_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>, Out<cl_uint>>
      static_add_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, Out<float>, Out<float>> static_pose_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>>
      static_travel_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_float, cl_float, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<float>>
      static_accumulate_;
  Kernel<cl_uint, cl_uint, cl_float, cl_uint, cl_float, In<float>, In<cl_uint>, In<cl_uint>,
         In<float>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      static_decide_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<float>, In<float>, Out<float>, Out<float>>
      static_settle_;
  RowMover rows_;
  bool sums_known_ = false;
  Buffer<float> gradient_sums_{"gradient sums"};  // [static Gaussians, 4] since the last round
  Buffer<cl_uint> source_{"source"}, child_{"child"};
};

}  // namespace gflow
