// SPDX-License-Identifier: Apache-2.0
// Paths of points through the frames of a camera, from a point tracker: a flow across any number of
// frames, known only at these points.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "optim/flow/flow_store.hpp"

namespace gflow {

// Positions of points in each frame of one track.
struct PointTracks {
  size_t frames = 0, points = 0;
  std::vector<float> xy;      // [frames, points, 2] in pixels, centres at .5
  std::vector<uint8_t> seen;  // [frames, points]; 1 if the point is visible
};

// Reads an .npz with `tracks` [frames, points, 2], in pixels of the stored images, first pixel
// centre at (.5, .5), and optionally `visibility` [frames, points], above .5 if visible.
// Non-finite positions are not visible. Error if there are no such arrays.
PointTracks read_point_tracks(const std::string& path);

// Flow of the points visible in both frames, each stored at its pixel (if two share one, the one
// nearer to the centre); invalid elsewhere. sx, sy: size of a track pixel in flow pixels. Emphasis
// is pixels / points, at most 16, so that a point counts as the area around it.
TargetFlow flow_of_points(const PointTracks& tracks, size_t from, size_t to, int width, int height,
                          float sx = 1, float sy = 1);

// Loaders of pairs[first] and later ones, from FOLDER/<camera name>.npz, or from the file `folder`
// if there is only one camera. No flow for pairs without a next frame. Error if a file is missing,
// has another number of frames than its camera or no point inside the images, if the camera has
// lens distortion, or if no camera has a visible point.
std::vector<FlowStore::Loader> track_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                                           size_t first, const FrameStore& frames,
                                           const std::string& folder);

}  // namespace gflow
