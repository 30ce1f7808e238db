// SPDX-License-Identifier: Apache-2.0
// Geometry of two frames of one moving camera.
#pragma once
#include <utility>
#include <vector>

#include "optim/cameras/bundle.hpp"

namespace gflow {

using FramePair = std::pair<int, int>;

// Where the tracks that cover both frames are seen in each.
struct Matches {
  std::vector<Eigen::Vector2d> first, second;  // [px]
};
Matches matches_of(const std::vector<FeatureTrack>& tracks, const FramePair& pair);

// Distance that a quarter of the tracks exceeds from one frame to another [px]; infinity if less
// than 60 % of the tracks of the first reach the other.
double motion_between(const std::vector<FeatureTrack>& tracks, const FramePair& pair);

// Whether most points stay where they are, within 1 px (times pixel_scale), as long as they are
// followed.
bool stands_still(const std::vector<FeatureTrack>& tracks, double pixel_scale);

// Frames that next to no track reaches from the frame before: a cut, or a large jump.
std::vector<int> breaks_of(const std::vector<FeatureTrack>& tracks, int frames);

// Pairs of keyframes with enough common tracks.
std::vector<FramePair> pairs_of(const std::vector<int>& keyframes,
                                const std::vector<FeatureTrack>& tracks);

// The pair from which a reconstruction starts: many tracks that fit one motion of the camera, seen
// from directions that differ. The translation has length 1.
struct FirstPair {
  FramePair frames;
  Eigen::Isometry3d second_from_first;
};
// pixel_scale: factor of tolerances. Error if the rays to the points differ too little in all
// pairs.
FirstPair first_pair(const std::vector<FramePair>& pairs, const std::vector<FeatureTrack>& tracks,
                     const SharedLens& lens, double pixel_scale);

}  // namespace gflow
