// SPDX-License-Identifier: Apache-2.0
// Points of a video followed from frame to frame: what camera poses are estimated from.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "optim/images/image.hpp"

namespace gflow {

// The image of one surface point in consecutive frames.
struct FeatureTrack {
  int first = 0;                        // frame of points[0]
  std::vector<Eigen::Vector2d> points;  // [px]

  int end() const { return first + int(points.size()); }  // the frame after the last
  bool covers(int frame) const { return frame >= first && frame < end(); }
  const Eigen::Vector2d& at(int frame) const { return points[size_t(frame - first)]; }
};

// What a tracker knows, apart from images.
struct TrackingState {
  // A track that reaches the last frame. It is compared with the image of frame `anchor`.
  struct Live {
    size_t track;
    int anchor;
    Eigen::Vector2d anchor_point;
  };

  int frames = 0;  // added so far
  std::vector<FeatureTrack> tracks;
  std::vector<Live> live;
};

// Follows corners through the flow between neighbouring frames. Each position is corrected by
// comparing the image around it with an earlier image of it, up to sixteen frames ago, so that
// errors of flow do not add up. A track ends where flow is not confident or the images differ. New
// ones start wherever there are none, so about `most` are alive in each frame.
class FeatureTracker {
 public:
  static constexpr int kKept = 16;  // frames for which an image is compared with later ones

  explicit FeatureTracker(int most = 1200);
  // Continues from a state. recent: the images of its last kKept frames, or of all.
  FeatureTracker(TrackingState state, const std::vector<std::shared_ptr<const Image>>& recent,
                 int most = 1200);
  ~FeatureTracker();

  // The next frame, RGB; all have one size.
  void add(std::shared_ptr<const Image> image);
  const TrackingState& state() const;
  // All tracks of at least three frames.
  std::vector<FeatureTrack> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gflow
