// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/upright.hpp"

#include <algorithm>

namespace gflow {
namespace {

constexpr double kMedianDistance = 4;

double middle_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + long(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void make_upright(const std::vector<FeatureTrack>& tracks, CameraPath& path) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& pose : path.poses)
    if (pose) up -= pose->rotation().row(1).transpose();  // a camera's y axis points down
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  if (up.norm() > 0)
    turn.linear() =
        Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();

  std::vector<double> axes[3], distances;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (!path.points[i]) continue;
    const Eigen::Vector3d p = turn * *path.points[i];
    for (int k = 0; k < 3; ++k) axes[k].push_back(p[k]);
    const auto& pose = path.poses[size_t(tracks[i].first + int(tracks[i].points.size()) / 2)];
    if (pose) distances.push_back((*pose * *path.points[i]).norm());
  }
  const Eigen::Vector3d origin(middle_of(axes[0]), middle_of(axes[1]), middle_of(axes[2]));
  const double distance = middle_of(distances);
  const double scale = distance > 0 ? kMedianDistance / distance : 1;
  for (auto& point : path.points)
    if (point) point = scale * (turn * *point - origin);
  for (auto& pose : path.poses) {
    if (!pose) continue;
    Eigen::Isometry3d eye = turn * pose->inverse();
    eye.translation() = scale * (eye.translation() - origin);
    pose = eye.inverse();
  }
}

}  // namespace gflow
