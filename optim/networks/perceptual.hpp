// SPDX-License-Identifier: Apache-2.0
// Perceptual metrics by ONNX networks: LPIPS and the image encoder of CLIP. Sources of the files
// are in apps/metrics/README.md.
#pragma once
#include <string>
#include <vector>

#include "optim/networks/network.hpp"

namespace gflow {

// An RGB image as planes [3, H, W] in [0, 1].
struct ColourPlanes {
  int width = 0, height = 0;
  std::vector<float> values;
};

// LPIPS (Zhang et al. 2018, The Unreasonable Effectiveness of Deep Features as a Perceptual
// Metric). The network has two inputs [1, 3, H, W] in [-1, 1], in file order the image and its
// ground truth; its first output is one number. H and W may be open.
class Lpips {
 public:
  // Errors as Network, and if the inputs do not match. `setting` is named in errors.
  Lpips(const std::string& path, const std::string& setting);
  // Error if the network takes images of another size.
  void require_size(int width, int height) const;
  // 0 for identical appearance. Error if sizes differ, or the output is not one finite number.
  double distance(const ColourPlanes& image, const ColourPlanes& truth);

 private:
  Network network_;
  std::string setting_;
};

// CLIP similarity (Radford et al. 2021): the cosine of two image embeddings. The network has one
// input [1, 3, S, S], made by clip_input; its first output is the embedding. An open S means 224.
class Clip {
 public:
  Clip(const std::string& path, const std::string& setting);
  // [-1, 1]. Error if the network fails, or embeddings are zero, non-finite or of different
  // lengths.
  double similarity(const ColourPlanes& image, const ColourPlanes& truth);

 private:
  std::vector<float> embedding(const ColourPlanes& image);

  Network network_;
  std::string setting_;
  int side_ = 224;
};

// CLIP's image preprocessing, [3, side, side]: resizes the shorter side to `side` (bicubic, a =
// -0.5, antialiased as in Pillow), crops the centre, clamps to [0, 1], subtracts CLIP's mean and
// divides by its standard deviation, per channel. Unlike Pillow it does not round to 8 bits after
// each pass.
std::vector<float> clip_input(const ColourPlanes& image, int side);

}  // namespace gflow
