// SPDX-License-Identifier: Apache-2.0
// A denoiser from an ONNX file, run by OpenCV. Inputs by name, all float32:
//
//   sample     [1, 3, H, W]  the noised image z; required
//   timestep   [1] or [1, 1] t, 0 to T - 1
//   condition  [1, 3, H, W]  the reference image in [-1, 1], resized to fit and centred on the
//                            background; 0 without condition
//   pose       [1, 4]        the view relative to the reference, as in Zero123 (Liu et al. 2023):
//                            change of the polar angle [rad], sin and cos of the change of azimuth,
//                            change of distance; 0 without condition
//
// The first output is the noise, [1, 3, H, W]. The network works on images. A latent diffusion
// model also needs the derivative of its encoder: use guidance.provider = "process" for it.
#pragma once
#include <string>
#include <vector>

#include "optim/guidance/denoiser.hpp"
#include "optim/networks/network.hpp"

namespace gflow {

class OnnxDenoiser : public Denoiser {
 public:
  // Errors as Network, and if input `sample` is missing or another input is unknown.
  explicit OnnxDenoiser(const std::string& path);
  std::vector<float> noise(const NoisyView& view, bool condition) override;
  std::string name() const override { return "the network " + network_.path(); }

 private:
  Network network_;
  std::vector<int64_t> sample_;  // shape of input `sample`
};

}  // namespace gflow
