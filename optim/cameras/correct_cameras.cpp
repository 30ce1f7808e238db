// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/correct_cameras.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/cameras/reconstruction.hpp"
#include "optim/scene/move_cameras.hpp"
#include "optim/scene/similarity.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

constexpr size_t kLeastKnownPoints = 100;  // that agree with the poses

bool have_one_lens(const std::vector<Camera>& cameras) {
  const Camera& a = cameras[0];
  return std::fabs(a.fx / a.fy - 1) < 1e-3 &&
         std::all_of(cameras.begin(), cameras.end(), [&](const Camera& b) {
           return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
                  a.cx == b.cx && a.cy == b.cy;
         });
}

Eigen::Isometry3d isometry(const Eigen::Matrix4d& viewmat) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(viewmat.topLeftCorner<3, 3>()).normalized().toRotationMatrix();
  pose.translation() = viewmat.topRightCorner<3, 1>();
  return pose;
}

double mean_turn(const std::vector<Camera>& from, const std::vector<Camera>& to) {
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Matrix3d turn =
        to[i].viewmat.topLeftCorner<3, 3>() * from[i].viewmat.topLeftCorner<3, 3>().transpose();
    sum += std::pow(Eigen::AngleAxisd(turn).angle() / degree, 2);
  }
  return std::sqrt(sum / double(from.size()));
}

}  // namespace

std::optional<double> correct_cameras(const Scene& scene, FrameStore& frames,
                                      const ProgressCallback& progress) {
  std::vector<const Frame*> views;
  for (const Frame& frame : scene.train) views.push_back(&frame);
  std::stable_sort(views.begin(), views.end(),
                   [](const Frame* a, const Frame* b) { return a->time < b->time; });
  std::vector<Camera> given;
  for (const Frame* view : views) given.push_back(frames.camera(*view));
  if (!have_one_lens(given)) {
    warn("cameras are not corrected before training: their focal lengths differ");
    return std::nullopt;
  }
  FeatureTracker tracker;
  for (size_t i = 0; i < views.size(); ++i) {
    tracker.add(frames.rgb(*views[i]));
    progress(i + 1, views.size());
  }
  const std::vector<FeatureTrack> tracks = tracker.finish();
  ReconstructionOptions options;
  options.frames = int(views.size());
  options.width = given[0].width;
  options.height = given[0].height;
  SharedLens lens;
  lens.focal = given[0].fx;
  lens.centre = {given[0].cx, given[0].cy};
  std::vector<Eigen::Isometry3d> poses;
  for (const Camera& camera : given) poses.push_back(isometry(camera.viewmat));
  const CameraPath path = adjusted(tracks, lens, poses, options);
  if (statistics_of(tracks, path).points < kLeastKnownPoints) {
    warn("cameras are not corrected before training: too few points can be followed");
    return std::nullopt;
  }
  std::vector<Camera> corrected = given;
  for (size_t i = 0; i < corrected.size(); ++i) corrected[i].viewmat = path.poses[i]->matrix();
  const Similarity back = similarity_between(corrected, given).value_or(Similarity{});
  std::map<size_t, Eigen::Matrix4d> moved;
  for (size_t i = 0; i < views.size(); ++i) {
    corrected[i].viewmat = back.pose(corrected[i].viewmat);
    moved[size_t(views[i]->camera)] = corrected[i].viewmat;
  }
  move_cameras(scene, moved, path.lens.focal / lens.focal, frames);
  return mean_turn(given, corrected);
}

}  // namespace gflow
