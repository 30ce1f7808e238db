// SPDX-License-Identifier: Apache-2.0
// Colours of cameras: cameras of a rig differ in exposure and white balance. Each shows colours x
// as x + M x + b (shared/camera_color.h), which is learned from its images; the mean over all
// cameras is 0. Held-out cameras, whose M and b nobody knows, are rendered without.
#pragma once
#include <string>

#include "optim/formats/npz.hpp"
#include "runtime/primitives/adam.hpp"
#include "shared/camera_color.h"

namespace gflow {

struct CameraColorRule {
  float rate = 1e-3f;   // learning rate
  float shrink = 0.1f;  // weight of the squares of M and b, relative to the image loss
};

class CameraColors {
 public:
  CameraColors(Queue& queue, size_t cameras, const CameraColorRule& rule);

  // What a camera shows of rgb [3, pixels]; valid until the next call.
  const Buffer<float>& show(Queue& queue, size_t camera, size_t pixels, const Buffer<float>& rgb);
  // Turns v_rgb [3, pixels], dL / d shown, into dL / d rgb, sets the camera's row of
  // colors().grads, and notes it as a visit. rgb as in show().
  void backward(Queue& queue, size_t camera, size_t pixels, const Buffer<float>& rgb,
                Buffer<float>& v_rgb);
  // Removes the last visit and returns its gradient [12]. Waits.
  std::vector<float> take_visit(Queue& queue);
  // Notes a visit of a camera with its gradient.
  void add_visit(Queue& queue, size_t camera, const std::vector<float>& gradient);
  // A step of Adam for each visit since the last call, in their order.
  void step(Queue& queue);

  // M and b of all cameras [cameras, 12].
  ParameterGroup& colors() { return colors_; }
  void save_state(Queue& queue, Arrays& arrays) const;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path);

 private:
  struct Visit {
    size_t camera;
    Buffer<float> gradient;  // [12]
  };
  Visit& begin_visit(Queue& queue, size_t camera);
  void step(Queue& queue, size_t camera);

  size_t cameras_;
  CameraColorRule rule_;
  Program program_;
  Kernel<cl_uint, cl_uint, In<float>, In<float>, Out<float>> camera_color_fwd_;
  Kernel<cl_uint, cl_uint, cl_uint, In<float>, In<float>, Out<float>, Out<float>> camera_color_bwd_;
  Kernel<cl_uint, cl_uint, cl_float, In<float>, In<float>, Out<float>> camera_color_grads_;
  Kernel<cl_uint, Out<float>> camera_color_center_;
  Adam adam_;
  ParameterGroup colors_;
  RowState rows_;
  std::vector<Visit> visits_;  // the first visited_ are those of this step
  size_t visited_ = 0;
  Buffer<float> shown_{"shown colours"}, partial_{"camera colour sums"};
};

}  // namespace gflow
