// SPDX-License-Identifier: Apache-2.0
// L1 and SSIM of a view against its image (loss.ssim).
#pragma once
#include <map>
#include <memory>
#include <optional>

#include "optim/loss/camera_colors.hpp"
#include "optim/loss/image_loss.hpp"
#include "optim/loss/loss_options.hpp"
#include "optim/loss/pixel_weights.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Whether training cameras get colours of their own (loss.camera_color).
bool have_own_colors(CameraColor choice, const Scene& scene);

class ImageObjective : public Objective {
 public:
  // ssim: share of 1 - SSIM in the loss, the rest is L1. foreground: weight of a pixel of the
  // foreground (FrameStore::foreground) relative to others; the mean weight of an image is 1.
  // colors: rule of the colours of cameras; nullopt: all cameras show the same.
  ImageObjective(Queue& queue, const Scene& scene, FrameStore& frames, float ssim, float foreground,
                 const std::optional<CameraColorRule>& colors = std::nullopt);

  void add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                     ImageGradients& v) override;
  std::vector<float> take_view(Queue& queue, const ViewContext& view) override;
  void give_view(Queue& queue, const ViewContext& view, const std::vector<float>& visit) override;
  void end_step(Queue& queue, const StepContext& context) override;
  // Reports the unweighted loss, l1, ssim and psnr [dB] of the last view.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  // Reads the rendered part of the image, on the background of the step.
  void read_truth(const ViewContext& view);
  // Reads which of its pixels count; counted_bytes_ is empty if all do.
  void read_counted(const ViewContext& view);
  void weigh_foreground(Queue& queue, const ViewContext& view, Buffer<float>& v_rgb);

  FrameStore& frames_;
  ImageLoss loss_;
  std::vector<cl_uchar> truth_bytes_;  // source of asynchronous writes
  Buffer<cl_uchar> truth_{"truth"};
  const Buffer<float>* shown_ = nullptr;  // the last view, as it was compared
  std::map<int, size_t> color_rows_;      // rows of colors_ by Frame::camera
  std::unique_ptr<CameraColors> colors_;  // nullptr: all cameras show the same
  float foreground_weight_;
  std::unique_ptr<PixelWeights> weights_;                   // made when a view has some
  std::vector<cl_uchar> counted_bytes_, foreground_bytes_;  // sources of asynchronous writes
  Buffer<cl_uchar> counted_{"counted"}, foreground_{"foreground"};
};

}  // namespace gflow
