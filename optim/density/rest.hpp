// SPDX-License-Identifier: Apache-2.0
// The static/dynamic split: Gaussians that need no motion lose its parameters and their optimiser
// state, and get them back when what they show pulls them into motion. For every motion model whose
// Gaussians have a motion of their own. Kernels: kernels/rest.cl.
//
// Whoever moves was made to move: at the start, by growing (RowMover), or by the pulls here. A
// round puts to rest those that, after a trial of some steps, stay near their mean pose.
#pragma once
#include "optim/density/rows.hpp"
#include "optim/formats/npz.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

struct RestRule {
  float most = 0.05f;   // furthest from the mean pose of who rests (kernels/shared/rest.h)
  float wake = 5;       // a sum of pulls so many times as long as noise's wakes; 0: none does
  unsigned trial = 50;  // steps that a Gaussian must have made before it may rest
  float duration = 1;   // length of the video [model time]
  int moments = 2;      // at which the poses are compared, from 0 to duration; >= 2
};

class Rest {
 public:
  explicit Rest(Queue& queue);

  // After a view: its gradients by the means at its time, and with flow at its second time, both in
  // the model's time. `stood_still`: those at rest did so in this view (View::moving).
  void see(Queue& queue, const Parameters& parameters, const ViewRows& rows,
           const Buffer<cl_uint>& tiles_touched, float t, const Buffer<float>& v_means,
           const float* t2, const Buffer<float>& v_means_t2, bool stood_still);

  // A round; forgets what was seen. Those that rest change by at most .74 rule.most of their
  // opacity at each of the moments. Returns for each new row the row it was. Those woken start with
  // zero moments and step counts, all others keep theirs. Waits. If memory runs out it throws, and
  // the parameters are as they were.
  const Buffer<cl_uint>& refine(Queue& queue, Parameters& parameters, Motion& motion,
                                const RestRule& rule);
  // When density control has moved the rows.
  void forget() { pulls_known_ = false; }

  // What lives from step to step: rest/pulls [resting, 4].
  void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays) const;
  void load_state(Queue& queue, const Parameters& parameters, const Arrays& arrays,
                  const std::string& path);

 private:
  void start_pulls(Queue& queue, const Parameters& parameters);

  Program program_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>, Out<cl_uint>>
      rest_add_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, Out<float>, Out<float>> rest_pose_;
  Kernel<cl_uint, In<float>, In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>>
      rest_travel_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_float, cl_float, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         In<float>, In<float>, Out<float>>
      rest_pull_;
  Kernel<cl_uint, cl_uint, cl_float, cl_uint, cl_float, In<float>, In<cl_uint>, In<cl_uint>,
         In<float>, Out<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      rest_decide_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<float>, In<float>, Out<float>, Out<float>>
      rest_settle_;
  RowMover rows_;
  bool pulls_known_ = false;
  Buffer<float> pulls_{"pulls"};  // [resting, 4] since the last round
  Buffer<cl_uint> source_{"source"}, child_{"child"};
};

}  // namespace gflow
