// SPDX-License-Identifier: Apache-2.0
// The timed work on a random scene: everything from its parameters to their next values.
#pragma once
#include "apps/bench/measure/scene.hpp"
#include "optim/options/train_options.hpp"
#include "runtime/primitives/adam.hpp"

namespace gflow::bench {

// One step without losses: parameters to image, image gradients to parameters, Adam. A scene from a
// file has Gaussians only, no parameters.
class WholeStep {
 public:
  WholeStep(Queue& queue, BenchScene& scene, Channels channels)
      : queue_(queue),
        scene_(scene),
        channels_(channels),
        v_(random_gradients(
            queue, size_t(scene.view.camera.width) * size_t(scene.view.camera.height), channels)),
        engine_(queue),
        rows_(queue),
        adam_(queue, {AdamOptions{}.beta1, AdamOptions{}.beta2}) {}

  void operator()() {
    BenchScene& s = scene_;
    if (s.motion) {
      s.motion->cull(queue_, *s.parameters, s.t1, s.view.camera, rows_);
      rows_.take_marked(queue_, *s.parameters);
      s.motion->at(queue_, *s.parameters, s.t1, nullptr, s.at_t1, rows_.list());
    }
    engine_.project(queue_, s.view, channels_, s.at_t1);
    const Buffer<cl_uint>& seen = engine_.splats().tiles_touched;
    if (s.motion && channels_.flow)
      s.motion->at(queue_, *s.parameters, s.t2, &seen, s.at_t2, rows_.list());
    const GaussiansAt& at_t2 = channels_.flow ? s.at_t2 : s.at_t1;
    engine_.draw(queue_, {0, 0, 0}, s.at_t1, at_t2, s.colors);
    engine_.backward(queue_, s.at_t1, at_t2, v_, g_);
    if (!s.motion) return;
    Parameters& p = *s.parameters;
    p.forget_seen(queue_);
    s.motion->backward(queue_, p, s.t1, true, seen, g_.v_means, g_.v_factors, g_.v_opacities,
                       rows_.list());
    if (channels_.flow)
      s.motion->backward(queue_, p, s.t2, false, seen, g_.v_means_t2, g_.v_factors_t2,
                         g_.v_opacities, rows_.list());
    for (const ParameterGroup& group : p.groups) adam_.refuse(queue_, group, p.rows, p.count);
    adam_.advance(queue_, p.rows, p.count);
    // The learning rate is so small that the scene does not change.
    for (ParameterGroup& group : p.groups)
      adam_.step(queue_, group, p.rows, p.count, {1e-12f, 1e-8f});
  }

  const Engine& engine() const { return engine_; }

 private:
  Queue& queue_;
  BenchScene& scene_;
  Channels channels_;
  ImageGradients v_;
  Engine engine_;
  ViewRows rows_;
  Adam adam_;
  GaussianGradients g_;
};

}  // namespace gflow::bench
