// SPDX-License-Identifier: Apache-2.0
// A denoiser in an ONNX file, run by OpenCV. Its inputs are known by name, all float32:
//
//   sample     [1, 3, H, W]  the noised picture z; required
//   timestep   [1] or [1, 1] t, 0 to T - 1
//   condition  [1, 3, H, W]  the reference picture in [-1, 1], in the middle of a square or of
//                            whatever shape it has, on the background; without condition 0
//   pose       [1, 4]        of the view as seen from the reference, as Zero123 (Liu et al. 2023)
//                            has it: change of the polar angle [rad], sin and cos of that of the
//                            azimuth, change of the distance; without condition 0
//
// Its first output is the noise, [1, 3, H, W]. It works on pictures: a model that works on latents
// needs its encoder's derivative and is a matter for guidance.provider = "process".
#pragma once
#include <string>
#include <vector>

#include "optim/guidance/denoiser.hpp"
#include "optim/networks/network.hpp"

namespace gflow {

class OnnxDenoiser : public Denoiser {
 public:
  // Error as Network's, and when it has no input `sample` or one of another name.
  explicit OnnxDenoiser(const std::string& path);
  std::vector<float> noise(const NoisyView& view, bool condition) override;
  std::string name() const override { return "the network " + network_.path(); }

 private:
  Network network_;
  std::vector<int64_t> sample_;  // sizes of that input
};

}  // namespace gflow
