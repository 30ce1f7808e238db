// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/feature_tracks.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <optional>
#include <utility>

#include "optim/flow/optical_flow.hpp"
#include "optim/images/opencv_threads.hpp"

namespace gflow {
namespace {

constexpr double kMostCorrection = 2;  // [px] of the flow by the comparison
constexpr float kMostDifference = 12;  // mean over the window [grey levels]
constexpr int kWindow = 15;            // [px]

// OpenCV counts pixels from the centre of the first one.
cv::Point2f to_opencv(const Eigen::Vector2d& p) { return {float(p.x() - .5), float(p.y() - .5)}; }
Eigen::Vector2d from_opencv(const cv::Point2f& p) { return {p.x + .5, p.y + .5}; }

cv::Mat grey_of(const Image& image) {
  cv::Mat result;
  cv::cvtColor(
      cv::Mat(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data())),
      result, cv::COLOR_RGB2GRAY);
  return result;
}

// Confident flow at the pixel of a position; nullopt without.
std::optional<Eigen::Vector2d> flow_at(const TargetFlow& target, const Eigen::Vector2d& p) {
  const int x = int(std::floor(p.x())), y = int(std::floor(p.y()));
  if (x < 0 || y < 0 || x >= target.flow.width || y >= target.flow.height) return {};
  const size_t i = size_t(y) * size_t(target.flow.width) + size_t(x);
  if (target.confidence[i] < 128) return {};
  return Eigen::Vector2d(target.flow.uv[2 * i], target.flow.uv[2 * i + 1]);
}

}  // namespace

struct FeatureTracker::State : TrackingState {
  int most;
  std::shared_ptr<const Image> last;
  std::deque<cv::Mat> greys;  // of the last frames

  State(TrackingState state, int most) : TrackingState(std::move(state)), most(most) {}
  void keep(std::shared_ptr<const Image> image, const cv::Mat& grey);
  void follow(const cv::Mat& grey, const TargetFlow& flow);
  void correct(const cv::Mat& grey, std::vector<Live>& group, std::vector<cv::Point2f>& guesses,
               std::vector<Live>& kept);
  void start(const cv::Mat& grey);
};

FeatureTracker::FeatureTracker(int most) : FeatureTracker({}, {}, most) {}
FeatureTracker::FeatureTracker(TrackingState state,
                               const std::vector<std::shared_ptr<const Image>>& recent, int most)
    : state_(std::make_unique<State>(std::move(state), most)) {
  limit_opencv_to_one_thread();
  for (const auto& image : recent) state_->keep(image, grey_of(*image));
}
FeatureTracker::~FeatureTracker() = default;

void FeatureTracker::State::keep(std::shared_ptr<const Image> image, const cv::Mat& grey) {
  greys.push_back(grey);
  if (greys.size() > kKept) greys.pop_front();
  last = std::move(image);
}

// Those of a group have one anchor frame.
void FeatureTracker::State::correct(const cv::Mat& grey, std::vector<Live>& group,
                                    std::vector<cv::Point2f>& guesses, std::vector<Live>& kept) {
  if (group.empty()) return;
  const int anchor = group[0].anchor;
  const cv::Mat& before = greys[greys.size() - size_t(frames - anchor)];
  std::vector<cv::Point2f> from, to = guesses;
  for (const Live& one : group) from.push_back(to_opencv(one.anchor_point));
  std::vector<uint8_t> found;
  std::vector<float> difference;
  cv::calcOpticalFlowPyrLK(before, grey, from, to, found, difference, {kWindow, kWindow}, 1,
                           {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 0.01},
                           cv::OPTFLOW_USE_INITIAL_FLOW, 1e-3);
  for (size_t k = 0; k < group.size(); ++k) {
    const Eigen::Vector2d p = from_opencv(to[k]);
    // Where the window leaves the image, its position is worth less.
    const double margin = 0.5 * kWindow;
    const bool inside = p.x() > margin && p.y() > margin && p.x() < grey.cols - margin &&
                        p.y() < grey.rows - margin;
    if (!found[k] || !inside || difference[k] > kMostDifference ||
        (p - from_opencv(guesses[k])).norm() > kMostCorrection)
      continue;
    tracks[group[k].track].points.push_back(p);
    if (frames - anchor == kKept) group[k] = {group[k].track, frames, p};
    kept.push_back(group[k]);
  }
}

void FeatureTracker::State::follow(const cv::Mat& grey, const TargetFlow& flow) {
  std::vector<std::vector<Live>> groups(kKept + 1);
  std::vector<std::vector<cv::Point2f>> guesses(kKept + 1);
  for (const Live& one : live) {
    const Eigen::Vector2d& last = tracks[one.track].points.back();
    const std::optional<Eigen::Vector2d> step = flow_at(flow, last);
    if (!step) continue;
    groups[size_t(frames - one.anchor)].push_back(one);
    guesses[size_t(frames - one.anchor)].push_back(to_opencv(last + *step));
  }
  live.clear();
  for (size_t age = 1; age < groups.size(); ++age) correct(grey, groups[age], guesses[age], live);
}

void FeatureTracker::State::start(const cv::Mat& grey) {
  if (int(live.size()) >= most) return;
  const double spacing = std::max(4.0, 0.6 * std::sqrt(double(grey.total()) / most));
  cv::Mat free(grey.size(), CV_8U, cv::Scalar(255));
  for (const Live& one : live)
    cv::circle(free, to_opencv(tracks[one.track].points.back()), int(spacing), 0, cv::FILLED);
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(grey, corners, most - int(live.size()), 0.003, spacing, free, 5);
  for (const cv::Point2f& corner : corners) {
    const Eigen::Vector2d p = from_opencv(corner);
    live.push_back({tracks.size(), frames, p});
    tracks.push_back({frames, {p}});
  }
}

void FeatureTracker::add(std::shared_ptr<const Image> image) {
  State& s = *state_;
  const cv::Mat grey = grey_of(*image);
  if (s.last) s.follow(grey, estimate_quick_flows(*s.last, *image).first);
  s.start(grey);
  s.keep(std::move(image), grey);
  ++s.frames;
}

const TrackingState& FeatureTracker::state() const { return *state_; }

std::vector<FeatureTrack> FeatureTracker::finish() {
  std::vector<FeatureTrack> result;
  for (FeatureTrack& track : state_->tracks)
    if (track.points.size() >= 3) result.push_back(std::move(track));
  state_->tracks.clear();
  state_->live.clear();
  return result;
}

}  // namespace gflow
