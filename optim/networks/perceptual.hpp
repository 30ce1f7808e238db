// SPDX-License-Identifier: Apache-2.0
// Networks that say how alike two pictures look, as ONNX files: LPIPS and the image encoder of
// CLIP. Where the files come from: apps/metrics/README.md.
#pragma once
#include <string>
#include <vector>

#include "optim/networks/network.hpp"

namespace gflow {

// A colour picture, planes [3, H, W] of R, G and B in [0, 1].
struct ColourPlanes {
  int width = 0, height = 0;
  std::vector<float> values;
};

// LPIPS (Zhang et al. 2018, The Unreasonable Effectiveness of Deep Features as a Perceptual
// Metric). The network has two inputs [1, 3, H, W], in the order of its file the picture and its
// truth, both as 2 x - 1, in [-1, 1]; its first output is one number. H and W may be open.
class Lpips {
 public:
  // Error as Network's, and when it has not two such inputs. `setting` is named in errors.
  Lpips(const std::string& path, const std::string& setting);
  // Error when its pictures have another size.
  void require_size(int width, int height) const;
  // 0 for pictures that look the same. Error when sizes differ, or what comes out is not one
  // number.
  double distance(const ColourPlanes& picture, const ColourPlanes& truth);

 private:
  Network network_;
  std::string setting_;
};

// Similarity of two pictures by CLIP (Radford et al. 2021): the cosine of their embeddings. The
// network has one input [1, 3, S, S], made by clip_input; its first output is the embedding. S
// open: 224.
class Clip {
 public:
  Clip(const std::string& path, const std::string& setting);
  // [-1, 1]. Error when the network fails, or an embedding has no length or not that of the other.
  double similarity(const ColourPlanes& picture, const ColourPlanes& truth);

 private:
  std::vector<float> embedding(const ColourPlanes& picture);

  Network network_;
  std::string setting_;
  int side_ = 224;
};

// What CLIP's own preprocessing makes of a picture, [3, side, side]: the shorter side is brought to
// `side` (bicubic, a = -0.5, widened when it shrinks, as Pillow does), the middle square cut out,
// values cut to [0, 1], and of each channel CLIP's mean is subtracted before it is divided by
// CLIP's deviation. Pillow rounds to 8 bits after each of its two passes; this does not.
std::vector<float> clip_input(const ColourPlanes& picture, int side);

}  // namespace gflow
