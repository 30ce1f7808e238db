// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/two_views.hpp"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <limits>
#include <opencv2/calib3d.hpp>

#include "optim/scene/camera.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr size_t kLeastMatches = 50;
constexpr size_t kMostPartners = 12;     // later keyframes with which one is compared
constexpr double kEnoughAngle = 10;      // more is no better [degrees]
constexpr double kMostTurned = 0.9;      // of the first pair: share that shows no travel
constexpr double kLeastMedianAngle = 1;  // of the first pair [degrees]

double median(std::vector<double> values) {
  const auto middle = values.begin() + long(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<cv::Point2d> normalized(const SharedLens& lens,
                                    const std::vector<Eigen::Vector2d>& pixels) {
  std::vector<cv::Point2d> result;
  for (const Eigen::Vector2d& pixel : pixels) {
    const Eigen::Vector3d ray = lens.unproject(pixel);
    result.emplace_back(ray.x(), ray.y());
  }
  return result;
}

struct PairGeometry {
  size_t inliers = 0;
  double angle = 0;   // median between the rays to a point [degrees]
  double planar = 0;  // share of the matches that a homography explains
  double turned = 0;  // share that a turn without travel explains
  Eigen::Isometry3d second_from_first = Eigen::Isometry3d::Identity();

  double score() const {
    return double(inliers) * std::min(angle, kEnoughAngle) * (planar > 0.9 ? 0.3 : 1) *
           (1 - turned);
  }
};

// Share of the matches that differ by the turn of the camera alone, up to a tolerance, of rays of
// length 1. The turn is fitted three times, each time to those that it explained before.
double share_turned(const std::vector<cv::Point2d>& a, const std::vector<cv::Point2d>& b,
                    double tolerance) {
  const auto ray = [](const cv::Point2d& p) {
    return Eigen::Vector3d(p.x, p.y, 1).normalized().eval();
  };
  std::vector<bool> fits(a.size(), true);
  size_t number = a.size();
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (size_t k = 0; k < a.size(); ++k)
      if (fits[k]) sum += ray(b[k]) * ray(a[k]).transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d both = svd.matrixU() * svd.matrixV().transpose();
    const Eigen::Matrix3d turn = svd.matrixU() *
                                 Eigen::Vector3d(1, 1, both.determinant()).asDiagonal() *
                                 svd.matrixV().transpose();
    std::vector<double> errors;
    for (size_t k = 0; k < a.size(); ++k) errors.push_back((ray(b[k]) - turn * ray(a[k])).norm());
    const double limit = std::max(2 * tolerance, median(errors));
    number = 0;
    for (size_t k = 0; k < a.size(); ++k) {
      fits[k] = errors[k] <= limit;
      number += errors[k] <= 2 * tolerance;
    }
  }
  return double(number) / double(a.size());
}

PairGeometry geometry_of(const Matches& matches, const SharedLens& lens, double pixel_scale) {
  PairGeometry result;
  const auto a = normalized(lens, matches.first), b = normalized(lens, matches.second);
  const double tolerance = pixel_scale / lens.focal;
  std::vector<uint8_t> inliers;
  const cv::Mat essential =
      cv::findEssentialMat(a, b, cv::Matx33d::eye(), cv::RANSAC, 0.999, tolerance, inliers);
  if (essential.rows != 3) return result;
  cv::Mat rotation, translation, points;
  result.inliers = size_t(cv::recoverPose(essential, a, b, cv::Matx33d::eye(), rotation,
                                          translation, 1e6, inliers, points));
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) result.second_from_first.linear()(r, c) = rotation.at<double>(r, c);
    result.second_from_first.translation()[r] = translation.at<double>(r);
  }
  const Eigen::Vector3d eye = result.second_from_first.inverse().translation();
  std::vector<double> angles;
  for (size_t k = 0; k < a.size(); ++k) {
    if (!inliers[k]) continue;
    const auto h = points.col(int(k));
    const Eigen::Vector3d p =
        Eigen::Vector3d(h.at<double>(0), h.at<double>(1), h.at<double>(2)) / h.at<double>(3);
    const double cosine = p.normalized().dot((p - eye).normalized());
    angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) / degree);
  }
  if (angles.empty()) return result;
  result.angle = median(angles);
  std::vector<uint8_t> planar;
  cv::findHomography(a, b, cv::RANSAC, tolerance, planar, 500, 0.99);
  result.planar = double(std::count(planar.begin(), planar.end(), 1)) / double(a.size());
  result.turned = share_turned(a, b, tolerance);
  return result;
}

}  // namespace

Matches matches_of(const std::vector<FeatureTrack>& tracks, const FramePair& pair) {
  Matches result;
  for (const FeatureTrack& track : tracks) {
    if (!track.covers(pair.first) || !track.covers(pair.second)) continue;
    result.first.push_back(track.at(pair.first));
    result.second.push_back(track.at(pair.second));
  }
  return result;
}

double motion_between(const std::vector<FeatureTrack>& tracks, const FramePair& pair) {
  size_t before = 0;
  for (const FeatureTrack& track : tracks) before += track.covers(pair.first);
  const Matches matches = matches_of(tracks, pair);
  std::vector<double> lengths;
  for (size_t k = 0; k < matches.first.size(); ++k)
    lengths.push_back((matches.first[k] - matches.second[k]).norm());
  if (lengths.empty() || double(lengths.size()) < 0.6 * double(before))
    return std::numeric_limits<double>::infinity();
  const auto quarter = lengths.begin() + long(lengths.size() * 3 / 4);
  std::nth_element(lengths.begin(), quarter, lengths.end());
  return *quarter;
}

bool stands_still(const std::vector<FeatureTrack>& tracks, double pixel_scale) {
  size_t still = 0;
  for (const FeatureTrack& track : tracks) {
    double farthest = 0;
    for (const Eigen::Vector2d& p : track.points)
      farthest = std::max(farthest, (p - track.points.front()).norm());
    still += farthest < pixel_scale;
  }
  return 2 * still > tracks.size();
}

std::vector<int> breaks_of(const std::vector<FeatureTrack>& tracks, int frames) {
  const auto n = size_t(frames);
  std::vector<size_t> in(n), across(n);  // across: from the frame before
  for (const FeatureTrack& track : tracks)
    for (int frame = track.first; frame < track.end(); ++frame) {
      ++in[size_t(frame)];
      across[size_t(frame)] += frame > track.first;
    }
  std::vector<int> result;
  for (int frame = 1; frame < frames; ++frame)
    if (10 * across[size_t(frame)] < std::min(in[size_t(frame)], in[size_t(frame) - 1]))
      result.push_back(frame);
  return result;
}

std::vector<FramePair> pairs_of(const std::vector<int>& keyframes,
                                const std::vector<FeatureTrack>& tracks) {
  std::vector<FramePair> pairs;
  for (size_t i = 0; i < keyframes.size(); ++i)
    for (size_t j = i + 1; j < std::min(keyframes.size(), i + 1 + kMostPartners); ++j) {
      const FramePair pair{keyframes[i], keyframes[j]};
      if (matches_of(tracks, pair).first.size() < kLeastMatches) break;
      pairs.push_back(pair);
    }
  return pairs;
}

FirstPair first_pair(const std::vector<FramePair>& pairs, const std::vector<FeatureTrack>& tracks,
                     const SharedLens& lens, double pixel_scale) {
  if (pairs.empty())
    throw Error(
        fmt::format("no two frames show {} common points: the images have too little texture, too "
                    "much blur or no order (`gflow cameras --method colmap` needs none)",
                    kLeastMatches));
  PairGeometry best;
  FramePair frames;
  for (const FramePair& pair : pairs) {
    const PairGeometry geometry = geometry_of(matches_of(tracks, pair), lens, pixel_scale);
    if (geometry.score() <= best.score()) continue;
    best = geometry;
    frames = pair;
  }
  if (best.angle < kLeastMedianAngle || best.turned > kMostTurned)
    throw Error(
        "the camera turns but does not travel, or so little that nothing can be placed in depth: "
        "it must move sideways");
  return {frames, best.second_from_first};
}

}  // namespace gflow
