// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/camera_moves.hpp"

#include <algorithm>

#include "optim/cameras/two_views.hpp"

namespace gflow {
namespace {

constexpr int kPlaces = 3;    // of the video
constexpr int kCompared = 3;  // frames at each
constexpr int kPoints = 400;
constexpr size_t kLeastPoints = 20;
constexpr double kBorder = 0.2;  // of width and height: what moves is more often in the middle

bool is_near_border(const Eigen::Vector2d& p, const Camera& size) {
  const double x = p.x() / size.width, y = p.y() / size.height;
  return std::min({x, 1 - x, y, 1 - y}) < kBorder;
}

bool moves_from(size_t begin, size_t stride, const std::vector<Frame>& frames, FrameStore& store) {
  FeatureTracker tracker(kPoints);
  for (int k = 0; k < kCompared; ++k) tracker.add(store.rgb(frames[begin + size_t(k) * stride]));
  const Camera& size = store.camera(frames[begin]);
  std::vector<FeatureTrack> tracks = tracker.finish();
  tracks.erase(std::remove_if(tracks.begin(), tracks.end(),
                              [&](const FeatureTrack& track) {
                                return !is_near_border(track.points[0], size);
                              }),
               tracks.end());
  return tracks.size() >= kLeastPoints && !stands_still(tracks, std::max(1.0, size.width / 640.0));
}

}  // namespace

// Neighbouring frames are compared, as a fast camera loses its points soon, and frames four apart,
// as a slow one moves little.
bool camera_moves(const std::vector<Frame>& frames, FrameStore& store) {
  for (const size_t stride : {size_t(1), size_t(4)}) {
    const size_t spanned = (kCompared - 1) * stride + 1;
    if (frames.size() < spanned) break;
    for (size_t place = 0; place < kPlaces; ++place)
      if (moves_from((frames.size() - spanned) * place / (kPlaces - 1), stride, frames, store))
        return true;
  }
  return false;
}

}  // namespace gflow
