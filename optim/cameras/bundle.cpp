// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/bundle.hpp"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include <array>

namespace gflow {
namespace {

using Pose = std::array<double, 6>;  // rotation vector, translation; world to camera

Pose pose_of(const Eigen::Isometry3d& transform) {
  const Eigen::AngleAxisd turn(transform.rotation());
  const Eigen::Vector3d r = turn.angle() * turn.axis(), t = transform.translation();
  return {r.x(), r.y(), r.z(), t.x(), t.y(), t.z()};
}

Eigen::Isometry3d transform_of(const Pose& pose) {
  const Eigen::Vector3d r(pose[0], pose[1], pose[2]);
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  if (r.norm() > 0) transform.linear() = Eigen::AngleAxisd(r.norm(), r.normalized()).matrix();
  transform.translation() = Eigen::Vector3d(pose[3], pose[4], pose[5]);
  return transform;
}

// Where a point is seen, less where it was seen [px]. lens: focal, k1.
struct ReprojectionError {
  Eigen::Vector2d seen_from_centre;

  template <class T>
  bool operator()(const T* lens, const T* pose, const T* point, T* residual) const {
    T p[3];
    ceres::AngleAxisRotatePoint(pose, point, p);
    for (int k = 0; k < 3; ++k) p[k] += pose[3 + k];
    if (p[2] < T(1e-6)) return false;
    const T x = p[0] / p[2], y = p[1] / p[2];
    const T scale = lens[0] * (T(1) + lens[1] * (x * x + y * y));
    residual[0] = scale * x - seen_from_centre.x();
    residual[1] = scale * y - seen_from_centre.y();
    return true;
  }
};

// Its warnings about single steps mean nothing to users.
void silence_ceres() { FLAGS_minloglevel = google::GLOG_FATAL; }

bool counts(const BundleOptions& options, const CameraPath& path, int frame) {
  return path.poses[size_t(frame)] && (options.with.empty() || options.with[size_t(frame)]);
}

}  // namespace

Eigen::Vector3d SharedLens::unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d distorted = (pixel - centre) / focal;
  Eigen::Vector2d p = distorted;
  for (int k = 0; k < 10 && k1 != 0; ++k) p = distorted / (1 + k1 * p.squaredNorm());
  return p.homogeneous();
}

double adjust_bundle(const std::vector<FeatureTrack>& tracks, const BundleOptions& options,
                     CameraPath& path) {
  silence_ceres();
  std::vector<Pose> poses(path.poses.size());
  for (size_t k = 0; k < poses.size(); ++k)
    if (path.poses[k]) poses[k] = pose_of(*path.poses[k]);
  double lens[2] = {path.lens.focal, path.lens.k1};

  ceres::Problem::Options ownership;
  ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::CauchyLoss robust(options.robust_px);
  ceres::Problem problem(ownership);
  ceres::ParameterBlockOrdering* order = new ceres::ParameterBlockOrdering;
  std::vector<bool> in_use(poses.size());
  size_t residuals = 0;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (!path.points[i]) continue;
    double* point = path.points[i]->data();
    int views = 0;
    for (int frame = tracks[i].first; frame < tracks[i].end(); ++frame)
      views += counts(options, path, frame) && path.used[i][size_t(frame - tracks[i].first)];
    if (views < (options.refine_points ? 2 : 1)) continue;
    for (int frame = tracks[i].first; frame < tracks[i].end(); ++frame) {
      if (!counts(options, path, frame) || !path.used[i][size_t(frame - tracks[i].first)]) continue;
      using Cost = ceres::AutoDiffCostFunction<ReprojectionError, 2, 2, 6, 3>;
      problem.AddResidualBlock(
          new Cost(new ReprojectionError{tracks[i].at(frame) - path.lens.centre}), &robust, lens,
          poses[size_t(frame)].data(), point);
      in_use[size_t(frame)] = true;
      ++residuals;
    }
    order->AddElementToGroup(point, 0);
    if (!options.refine_points) problem.SetParameterBlockConstant(point);
  }
  if (residuals == 0) {
    delete order;
    return 0;
  }
  bool any_fixed = false;
  for (size_t k = 0; k < poses.size(); ++k) {
    if (!in_use[k]) continue;
    order->AddElementToGroup(poses[k].data(), 1);
    const bool first = options.fixed.empty() && options.refine_points && !any_fixed;
    if (first || (!options.fixed.empty() && options.fixed[k])) {
      problem.SetParameterBlockConstant(poses[k].data());
      any_fixed = true;
    }
  }
  order->AddElementToGroup(lens, 1);
  std::vector<int> constant;
  if (!options.refine_focal) constant.push_back(0);
  if (!options.refine_k1) constant.push_back(1);
  if (constant.size() == 2)
    problem.SetParameterBlockConstant(lens);
  else if (!constant.empty())
    problem.SetManifold(lens, new ceres::SubsetManifold(2, constant));

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.linear_solver_ordering.reset(order);
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = 1e-7;
  solver.num_threads = 1;  // the same bits on every machine
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);

  for (size_t k = 0; k < poses.size(); ++k)
    if (in_use[k]) path.poses[k] = transform_of(poses[k]);
  path.lens.focal = lens[0];
  path.lens.k1 = lens[1];
  return 2 * summary.final_cost / double(residuals);
}

}  // namespace gflow
