// SPDX-License-Identifier: Apache-2.0
// Paths of points through the pictures of a camera, as point trackers make them: a flow over any
// number of pictures that is known at these points only.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "optim/flow/flow_store.hpp"

namespace gflow {

// Where points are in each picture of one track.
struct PointTracks {
  size_t pictures = 0, points = 0;
  std::vector<float> xy;      // [pictures, points, 2] pixels, centres at .5
  std::vector<uint8_t> seen;  // [pictures, points] 1 where the point is in sight
};

// Reads an .npz with `tracks` [pictures, points, 2], in pixels of the pictures as they are stored,
// the first pixel's centre at (.5, .5), and, where not all points are always in sight, `visibility`
// [pictures, points], above .5 where they are. A place that is not finite is out of sight. Error
// when it holds no such arrays.
PointTracks read_point_tracks(const std::string& path);

// The flow of the points that are in sight in both pictures, each at the pixel that it lies in
// (of two the one nearer to the centre), nothing elsewhere. sx, sy: size of a pixel of the tracks
// in pixels of the flow. Each point counts as what is free around it, 16 pixels at most.
TeacherFlow flow_of_points(const PointTracks& tracks, size_t from, size_t to, int width, int height,
                           float sx = 1, float sy = 1);

// Loaders of pairs[first] and those after it, from FOLDER/<camera name>.npz; `folder` itself may be
// the file where one camera filmed everything. None for pairs without a next frame. Error when a
// file is missing, has not as many pictures as its camera, no point inside them, or belongs to
// pictures with a lens, and when no camera has a point in sight.
std::vector<FlowStore::Loader> track_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                                           size_t first, const FrameStore& frames,
                                           const std::string& folder);

}  // namespace gflow
