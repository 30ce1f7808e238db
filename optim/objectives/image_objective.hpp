// SPDX-License-Identifier: Apache-2.0
// L1 and SSIM of a view against its image (settings loss.ssim, skip.compact).
#pragma once
#include "optim/loss/image_loss.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

class ImageObjective : public Objective {
 public:
  // ssim: share of 1 - SSIM in the loss, the rest is L1. compact: images are uploaded as bytes,
  // otherwise as floats.
  ImageObjective(Queue& queue, FrameStore& frames, float ssim, bool compact);

  void add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                     ImageGradients& v) override;
  // Reports loss, l1, ssim and psnr [dB] of the last view.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;

  // Size of the last image on the device [bytes].
  size_t image_bytes() const { return truth_.size() + sizeof(float) * truth_as_floats_.size(); }

 private:
  // Reads the rendered part of the image, on the background of the step.
  void read_truth(const ViewContext& view);

  FrameStore& frames_;
  ImageLoss loss_;
  bool compact_;
  std::vector<cl_uchar> truth_bytes_;  // source of asynchronous writes
  std::vector<float> truth_floats_;
  Buffer<cl_uchar> truth_{"truth"};
  Buffer<float> truth_as_floats_{"truth as floats"};
};

}  // namespace gflow
