// SPDX-License-Identifier: Apache-2.0
// Nearest neighbours among many points, by a k-d tree.
#pragma once
#include <memory>
#include <vector>

namespace gflow {

class NearestPoints {
 public:
  // Builds the tree over points [n, 3], which must outlive it.
  explicit NearestPoints(const std::vector<float>& xyz);
  ~NearestPoints();

  struct Near {
    size_t index;
    float squared;  // squared distance
  };
  // The k points nearest to `point`, nearest first; fewer if there are fewer. A point of the set
  // finds itself first. Valid until the next call.
  const std::vector<Near>& of(const float* point, size_t k);

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
  std::vector<Near> found_;
  std::vector<size_t> index_;
  std::vector<float> squared_;
};

}  // namespace gflow
