// SPDX-License-Identifier: Apache-2.0
// Keyframes are placed one by one, starting from the pair with the best geometry; bundle adjustment
// in between. The other frames follow. The first pairs hardly determine the focal length, the whole
// does: if it differs from the one at the start, all is done again with it.
#include "optim/cameras/reconstruction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "optim/cameras/two_views.hpp"
#include "optim/images/opencv_threads.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr double kLeastAngle = 1.5;        // between the rays to a point [degrees]
constexpr size_t kLeastObservations = 20;  // of known points, to place a frame
constexpr double kGrowth = 1.2;            // of the placed frames from one adjustment to the next
constexpr double kUsualFocal = 0.8;        // of phones, in multiples of the longer side
constexpr double kSameFocal = 0.03;        // a start further from the result is repeated from it
constexpr int kMostRounds = 4;
constexpr size_t kMostObservations = 400000;  // in the adjustment of all frames

class Reconstruction {
 public:
  Reconstruction(const std::vector<FeatureTrack>& tracks, const ReconstructionOptions& options)
      : tracks_(tracks), options_(options), scale_(std::max(1.0, options.width / 640.0)) {
    limit_opencv_to_one_thread();
    path_.lens.centre = {0.5 * options.width, 0.5 * options.height};
    path_.poses.resize(size_t(options.frames));
    path_.points.resize(tracks.size());
    for (const FeatureTrack& track : tracks) path_.used.emplace_back(track.points.size(), true);
  }

  // Starts with a focal length [px].
  CameraPath run(double focal) {
    path_.lens.focal = focal;
    choose_keyframes();
    begin(pairs_of(keyframes_, tracks_));
    place_keyframes();
    refine();
    place_the_rest();
    return std::move(path_);
  }

  // Starts with all poses. Errors of 40 px are expected, then less and less.
  CameraPath run(const SharedLens& lens, const std::vector<Eigen::Isometry3d>& poses) {
    path_.lens = lens;
    path_.poses.assign(poses.begin(), poses.end());
    for (const double wide : {20., 10., 5., 2.}) {
      tolerance_ = wide;
      for (auto& point : path_.points) point.reset();
      triangulate();
      adjust(false, 30);
    }
    tolerance_ = 1;
    for (auto& point : path_.points) point.reset();
    triangulate();
    refine();
    return std::move(path_);
  }

 private:
  double most_error() const { return 2 * tolerance_ * scale_; }  // of an observation in use [px]

  // A frame is a keyframe if a quarter of the image moved by 3 % of its diagonal since the last
  // one, or many tracks have ended.
  void choose_keyframes() {
    const double least = 0.03 * std::hypot(options_.width, options_.height);
    keyframes_ = {0};
    for (int frame = 1; frame < options_.frames; ++frame)
      if (frame + 1 == options_.frames ||
          motion_between(tracks_, {keyframes_.back(), frame}) >= least)
        keyframes_.push_back(frame);
  }

  std::vector<Eigen::Vector2d> undistorted(const std::vector<Eigen::Vector2d>& pixels) const {
    std::vector<Eigen::Vector2d> result;
    for (const Eigen::Vector2d& pixel : pixels)
      result.push_back(path_.lens.centre +
                       path_.lens.focal * path_.lens.unproject(pixel).head<2>());
    return result;
  }

  void begin(const std::vector<FramePair>& pairs) {
    const FirstPair first = first_pair(pairs, tracks_, path_.lens, scale_);
    path_.poses[size_t(first.frames.first)] = Eigen::Isometry3d::Identity();
    path_.poses[size_t(first.frames.second)] = first.second_from_first;
    triangulate();
    adjust(false, 20);
    reject();
    triangulate();
  }

  void adjust(bool refine_focal, int iterations) {
    BundleOptions how;
    how.refine_focal = refine_focal && options_.focal == 0;
    how.refine_k1 = refine_focal && options_.radial;
    how.robust_px = 0.3 * tolerance_ * scale_;
    how.iterations = iterations;
    adjust_bundle(tracks_, how, path_);
  }

  // Frames of a track that are placed, and in use if `used`.
  template <class Use>
  void for_placed(size_t i, bool used, Use&& use) const {
    const FeatureTrack& track = tracks_[i];
    for (int frame = track.first; frame < track.end(); ++frame)
      if (path_.poses[size_t(frame)] && (!used || path_.used[i][size_t(frame - track.first)]))
        use(frame);
  }

  double error_in(size_t i, int frame, const Eigen::Vector3d& point) const {
    const Eigen::Vector3d p = *path_.poses[size_t(frame)] * point;
    if (p.z() <= 0) return std::numeric_limits<double>::infinity();
    return (path_.lens.project(p) - tracks_[i].at(frame)).norm();
  }

  std::optional<Eigen::Vector3d> triangulated(size_t i, const std::vector<int>& frames) const {
    Eigen::MatrixXd rows(2 * long(frames.size()), 4);
    for (size_t k = 0; k < frames.size(); ++k) {
      const Eigen::Vector3d ray = path_.lens.unproject(tracks_[i].at(frames[k]));
      const Eigen::Matrix4d pose = path_.poses[size_t(frames[k])]->matrix();
      rows.row(2 * long(k)) = ray.x() * pose.row(2) - pose.row(0);
      rows.row(2 * long(k) + 1) = ray.y() * pose.row(2) - pose.row(1);
    }
    const Eigen::Matrix4d normal = rows.transpose() * rows;
    const Eigen::Vector4d h =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(normal).eigenvectors().col(0);
    if (std::fabs(h.w()) < 1e-9 * h.norm()) return {};
    return h.head<3>() / h.w();
  }

  double widest_angle(const Eigen::Vector3d& point, const std::vector<int>& frames) const {
    double least = 1;
    const auto ray = [&](int frame) {
      const Eigen::Isometry3d& pose = *path_.poses[size_t(frame)];
      const Eigen::Vector3d eye = -(pose.rotation().transpose() * pose.translation());
      return (point - eye).normalized().eval();
    };
    for (const int frame : frames)
      least = std::min(
          {least, ray(frames.front()).dot(ray(frame)), ray(frames.back()).dot(ray(frame))});
    return std::acos(std::min(1.0, least)) / degree;
  }

  // A place of track i that most of its observations agree with: by all of them, else by the pairs
  // (first, k) and (k, last).
  void locate(size_t i) {
    std::vector<int> frames;
    for_placed(i, false, [&](int frame) { frames.push_back(frame); });
    if (frames.size() < 2) return;
    const auto agreeing = [&](const Eigen::Vector3d& point) {
      std::vector<int> result;
      for (const int frame : frames)
        if (error_in(i, frame, point) < most_error()) result.push_back(frame);
      return result;
    };
    std::optional<Eigen::Vector3d> best;
    std::vector<int> most;
    const auto consider = [&](const std::vector<int>& from) {
      const std::optional<Eigen::Vector3d> point = triangulated(i, from);
      if (!point) return;
      std::vector<int> agree = agreeing(*point);
      if (agree.size() <= most.size()) return;
      best = point;
      most = std::move(agree);
    };
    consider(frames);
    for (size_t k = 1; k < frames.size() && most.size() < frames.size(); ++k) {
      consider({frames[0], frames[k]});
      if (k + 1 < frames.size()) consider({frames[k], frames.back()});
    }
    if (most.size() < 2 || double(most.size()) < 0.6 * double(frames.size())) return;
    if (const auto refined = triangulated(i, most);
        refined && agreeing(*refined).size() >= most.size())
      best = refined;
    if (widest_angle(*best, most) < kLeastAngle) return;
    path_.points[i] = best;
    for (const int frame : frames)
      path_.used[i][size_t(frame - tracks_[i].first)] = error_in(i, frame, *best) < most_error();
  }

  void triangulate() {
    for (size_t i = 0; i < tracks_.size(); ++i)
      if (!path_.points[i]) locate(i);
  }

  // Observations far from their projections, and points that have too few others.
  void reject() {
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (!path_.points[i]) continue;
      std::vector<int> all, good;
      for_placed(i, false, [&](int frame) { all.push_back(frame); });
      for (const int frame : all) {
        const bool fits = error_in(i, frame, *path_.points[i]) < most_error();
        path_.used[i][size_t(frame - tracks_[i].first)] = fits;
        if (fits) good.push_back(frame);
      }
      if (good.size() < 2 || double(good.size()) < 0.6 * double(all.size()) ||
          widest_angle(*path_.points[i], good) < kLeastAngle)
        path_.points[i].reset();
    }
  }

  size_t known_in(int frame) const {
    size_t count = 0;
    for (size_t i = 0; i < tracks_.size(); ++i)
      count += path_.points[i] && tracks_[i].covers(frame);
    return count;
  }

  bool place(int frame) {
    std::vector<cv::Point3d> world;
    std::vector<Eigen::Vector2d> seen;
    std::vector<size_t> which;
    for (size_t i = 0; i < tracks_.size(); ++i) {
      if (!path_.points[i] || !tracks_[i].covers(frame)) continue;
      const Eigen::Vector3d& p = *path_.points[i];
      world.emplace_back(p.x(), p.y(), p.z());
      seen.push_back(tracks_[i].at(frame));
      which.push_back(i);
    }
    if (world.size() < kLeastObservations) return false;
    std::vector<cv::Point2d> pixels;
    for (const Eigen::Vector2d& p : undistorted(seen)) pixels.emplace_back(p.x(), p.y());
    const cv::Matx33d k(path_.lens.focal, 0, path_.lens.centre.x(), 0, path_.lens.focal,
                        path_.lens.centre.y(), 0, 0, 1);
    cv::Mat turn, shift;
    std::vector<int> inliers;
    if (!cv::solvePnPRansac(world, pixels, k, cv::noArray(), turn, shift, false, 300,
                            float(1.5 * most_error()), 0.999, inliers, cv::SOLVEPNP_AP3P))
      return false;
    if (inliers.size() < kLeastObservations || 3 * inliers.size() < world.size()) return false;
    cv::Matx33d rotation;
    cv::Rodrigues(turn, rotation);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) pose.linear()(r, c) = rotation(r, c);
      pose.translation()[r] = shift.at<double>(r);
    }
    path_.poses[size_t(frame)] = pose;
    for (const size_t i : which)
      path_.used[i][size_t(frame - tracks_[i].first)] =
          error_in(i, frame, *path_.points[i]) < 2 * most_error();
    refine_pose(frame);
    return true;
  }

  void refine_pose(int frame) {
    BundleOptions how;
    how.refine_focal = how.refine_points = false;
    how.robust_px = 0.3 * scale_;
    how.iterations = 10;
    how.with.assign(path_.poses.size(), false);
    how.with[size_t(frame)] = true;
    adjust_bundle(tracks_, how, path_);
  }

  void report() const {
    if (!options_.progress) return;
    size_t placed = 0;
    for (const auto& pose : path_.poses) placed += pose.has_value();
    options_.progress(placed, path_.poses.size());
  }

  void place_keyframes() {
    size_t placed = 2, adjusted = 2;
    std::vector<bool> failed(size_t(options_.frames));
    for (;;) {
      int best = -1;
      size_t most = kLeastObservations - 1;
      for (const int frame : keyframes_) {
        if (path_.poses[size_t(frame)] || failed[size_t(frame)]) continue;
        if (const size_t known = known_in(frame); known > most) most = known, best = frame;
      }
      if (best < 0) break;
      if (!place(best)) {
        failed[size_t(best)] = true;
        continue;
      }
      ++placed;
      std::fill(failed.begin(), failed.end(), false);
      triangulate();
      report();
      if (double(placed) < kGrowth * double(adjusted)) continue;
      adjust(placed >= 4, 15);
      reject();
      triangulate();
      adjusted = placed;
    }
  }

  void refine() {
    for (int round = 0; round < 3; ++round) {
      adjust(true, 40);
      reject();
      triangulate();
    }
    adjust(true, 40);
  }

  // Starts from the pose between the two nearest placed frames.
  bool place_between(int frame) {
    int before = frame, after = frame;
    while (before >= 0 && !path_.poses[size_t(before)]) --before;
    while (after < options_.frames && !path_.poses[size_t(after)]) ++after;
    if (before < 0 || after >= options_.frames) return place(frame);
    const Eigen::Isometry3d a = path_.poses[size_t(before)]->inverse(),
                            b = path_.poses[size_t(after)]->inverse();
    const double share = double(frame - before) / (after - before);
    Eigen::Isometry3d between = Eigen::Isometry3d::Identity();
    between.linear() = Eigen::Quaterniond(a.rotation())
                           .slerp(share, Eigen::Quaterniond(b.rotation()))
                           .toRotationMatrix();
    between.translation() = (1 - share) * a.translation() + share * b.translation();
    if (known_in(frame) < kLeastObservations) return false;
    path_.poses[size_t(frame)] = between.inverse();
    for (size_t i = 0; i < tracks_.size(); ++i)
      if (path_.points[i] && tracks_[i].covers(frame))
        path_.used[i][size_t(frame - tracks_[i].first)] =
            std::isfinite(error_in(i, frame, *path_.points[i]));  // in front of the camera
    refine_pose(frame);
    return true;
  }

  void place_the_rest() {
    for (int frame = 0; frame < options_.frames; ++frame)
      if (!path_.poses[size_t(frame)] && place_between(frame)) {
        triangulate();
        report();
      }
    reject();
    triangulate();
    size_t observations = 0;
    for (size_t i = 0; i < tracks_.size(); ++i)
      if (path_.points[i]) for_placed(i, true, [&](int) { ++observations; });
    if (observations > kMostObservations) return;
    for (int round = 0; round < 2; ++round) {
      adjust(true, 30);
      reject();
      triangulate();
    }
  }

  const std::vector<FeatureTrack>& tracks_;
  const ReconstructionOptions& options_;
  double scale_;          // of tolerances in pixels
  double tolerance_ = 1;  // likewise, while poses are still wrong
  std::vector<int> keyframes_;
  CameraPath path_;
};

}  // namespace

CameraPath reconstruct(const std::vector<FeatureTrack>& tracks,
                       const ReconstructionOptions& options) {
  if (stands_still(tracks, std::max(1.0, options.width / 640.0)))
    throw Error(
        "the camera does not move: most points stay where they are in the image; `gflow train` "
        "takes a camera for static");
  if (options.focal > 0) return Reconstruction(tracks, options).run(options.focal);
  double focal = kUsualFocal * std::max(options.width, options.height);
  for (int round = 1;; ++round) {
    CameraPath path = Reconstruction(tracks, options).run(focal);
    if (round == kMostRounds || std::fabs(path.lens.focal / focal - 1) < kSameFocal) return path;
    focal = path.lens.focal;
  }
}

CameraPath adjusted(const std::vector<FeatureTrack>& tracks, const SharedLens& lens,
                    const std::vector<Eigen::Isometry3d>& poses,
                    const ReconstructionOptions& options) {
  return Reconstruction(tracks, options).run(lens, poses);
}

ReprojectionStatistics statistics_of(const std::vector<FeatureTrack>& tracks,
                                     const CameraPath& path) {
  ReprojectionStatistics s;
  std::vector<double> errors;
  for (size_t i = 0; i < tracks.size(); ++i) {
    s.points += path.points[i].has_value();
    for (int frame = tracks[i].first; path.points[i] && frame < tracks[i].end(); ++frame) {
      if (!path.poses[size_t(frame)]) continue;
      if (!path.used[i][size_t(frame - tracks[i].first)]) {
        ++s.rejected;
        continue;
      }
      const Eigen::Vector3d p = *path.poses[size_t(frame)] * *path.points[i];
      errors.push_back((path.lens.project(p) - tracks[i].at(frame)).norm());
      s.mean += errors.back();
    }
  }
  s.observations = errors.size();
  if (errors.empty()) return s;
  s.mean /= double(errors.size());
  std::nth_element(errors.begin(), errors.begin() + long(errors.size() / 2), errors.end());
  s.median = errors[errors.size() / 2];
  return s;
}

}  // namespace gflow
