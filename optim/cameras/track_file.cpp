// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/track_file.hpp"

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "optim/formats/npz.hpp"

namespace gflow {
namespace {

// Increased whenever the same images give other tracks.
std::string with_version(const std::string& stamp) { return "feature tracks 1\n" + stamp; }

template <class T>
Array array_of(std::vector<T> values, std::vector<size_t> shape) {
  return {std::move(shape), std::move(values)};
}

TrackingState state_of(const Arrays& arrays, const std::string& path) {
  const auto size = [&](const char* name) { return array_named(arrays, name, path).size(); };
  const size_t tracks = size("first"), live = size("live_track"), points = size("points") / 2;
  const auto& first = exact_values<int32_t>(arrays, "first", {tracks}, path);
  const auto& length = exact_values<int32_t>(arrays, "length", {tracks}, path);
  const auto& xy = exact_values<double>(arrays, "points", {points, 2}, path);
  const auto& track = exact_values<int64_t>(arrays, "live_track", {live}, path);
  const auto& anchor = exact_values<int32_t>(arrays, "live_anchor", {live}, path);
  const auto& anchor_xy = exact_values<double>(arrays, "live_point", {live, 2}, path);
  if (std::accumulate(length.begin(), length.end(), size_t(0)) != points)
    throw Error(fmt::format("{}: its tracks have another number of points", path));
  TrackingState state;
  state.frames = exact_values<int32_t>(arrays, "frames", {1}, path)[0];
  size_t at = 0;
  for (size_t i = 0; i < tracks; ++i) {
    FeatureTrack one{first[i], {}};
    for (int k = 0; k < length[i]; ++k, ++at) one.points.emplace_back(xy[2 * at], xy[2 * at + 1]);
    state.tracks.push_back(std::move(one));
  }
  for (size_t i = 0; i < live; ++i)
    state.live.push_back({size_t(track[i]), anchor[i], {anchor_xy[2 * i], anchor_xy[2 * i + 1]}});
  return state;
}

}  // namespace

void write_tracks(const std::string& path, const std::string& stamp, const TrackingState& state) {
  std::vector<int32_t> first, length, anchor;
  std::vector<int64_t> track;
  std::vector<double> points, anchor_points;
  for (const FeatureTrack& one : state.tracks) {
    first.push_back(one.first);
    length.push_back(int32_t(one.points.size()));
    for (const Eigen::Vector2d& p : one.points) points.insert(points.end(), {p.x(), p.y()});
  }
  for (const TrackingState::Live& one : state.live) {
    track.push_back(int64_t(one.track));
    anchor.push_back(one.anchor);
    anchor_points.insert(anchor_points.end(), {one.anchor_point.x(), one.anchor_point.y()});
  }
  const size_t tracks = first.size(), live = track.size(), count = points.size() / 2;
  Arrays arrays;
  const std::string full = with_version(stamp);
  arrays["stamp"] = array_of<uint8_t>({full.begin(), full.end()}, {full.size()});
  arrays["frames"] = array_of<int32_t>({state.frames}, {1});
  arrays["first"] = array_of(std::move(first), {tracks});
  arrays["length"] = array_of(std::move(length), {tracks});
  arrays["points"] = array_of(std::move(points), {count, 2});
  arrays["live_track"] = array_of(std::move(track), {live});
  arrays["live_anchor"] = array_of(std::move(anchor), {live});
  arrays["live_point"] = array_of(std::move(anchor_points), {live, 2});
  write_npz(path, arrays, Packing::stored);
}

std::optional<TrackingState> read_tracks(const std::string& path, const std::string& stamp) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    const Arrays arrays = read_npz(path);
    const std::string full = with_version(stamp);
    const auto& written = exact_values<uint8_t>(arrays, "stamp", {full.size()}, path);
    if (!std::equal(written.begin(), written.end(), full.begin())) return std::nullopt;
    return state_of(arrays, path);
  } catch (const Error&) {  // of another version or video, or damaged: they are made again
    return std::nullopt;
  }
}

}  // namespace gflow
