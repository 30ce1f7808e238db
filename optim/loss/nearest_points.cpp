// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/nearest_points.hpp"

#include <nanoflann.hpp>

namespace gflow {
namespace {

struct PointAdaptor {
  const std::vector<float>& xyz;
  size_t kdtree_get_point_count() const { return xyz.size() / 3; }
  float kdtree_get_pt(size_t i, size_t dim) const { return xyz[3 * i + dim]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointAdaptor>,
                                        PointAdaptor, 3, size_t>;

}  // namespace

struct NearestPoints::Tree {
  explicit Tree(const std::vector<float>& xyz) : points{xyz}, tree(3, points) {}
  PointAdaptor points;
  KdTree tree;
};

NearestPoints::NearestPoints(const std::vector<float>& xyz) : tree_(std::make_unique<Tree>(xyz)) {}
NearestPoints::~NearestPoints() = default;

const std::vector<NearestPoints::Near>& NearestPoints::of(const float* point, size_t k) {
  index_.resize(k);
  squared_.resize(k);
  found_.clear();
  const size_t found = tree_->tree.knnSearch(point, k, index_.data(), squared_.data());
  for (size_t i = 0; i < found; ++i) found_.push_back({index_[i], squared_[i]});
  return found_;
}

}  // namespace gflow
