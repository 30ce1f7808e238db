// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/point_tracks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "optim/formats/npz.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr float farthest_place = 1e6f;  // [px]; positions beyond it are invalid
constexpr double most_of_area = 16;     // [px]; limit of the area one point represents

// The frames of one track: a range of Scene::train.
struct Film {
  int first = 0, count = 0;
};

std::map<int, Film> films_of(const Scene& scene) {
  std::map<int, Film> films;
  for (size_t i = 0; i < scene.train.size(); ++i) {
    const auto [film, is_new] = films.try_emplace(scene.train[i].track);
    if (is_new) film->second.first = int(i);
    ++film->second.count;
  }
  return films;
}

}  // namespace

PointTracks read_point_tracks(const std::string& path) {
  const Arrays arrays = read_npz(path, {"tracks", "visibility"});
  if (!arrays.count("tracks"))
    throw Error(fmt::format(
        "{} has no array 'tracks': expected shape (frames, points, 2), x and y in pixels", path));
  const Array& xy = arrays.at("tracks");
  if (xy.shape.size() != 3 || xy.shape[0] < 1 || xy.shape[1] < 1 || xy.shape[2] != 2)
    throw Error(fmt::format(
        "{}: array 'tracks' has shape {}, expected (frames, points, 2), x and y in pixels", path,
        xy.shape_text()));
  PointTracks tracks{xy.shape[0], xy.shape[1], xy.as_float(), {}};
  tracks.seen.assign(tracks.frames * tracks.points, 1);
  if (arrays.count("visibility")) {
    const Array& visibility = arrays.at("visibility");
    if (visibility.shape != std::vector<size_t>{tracks.frames, tracks.points})
      throw Error(
          fmt::format("{}: array 'visibility' has shape {}, expected ({}, {}) as in 'tracks'", path,
                      visibility.shape_text(), tracks.frames, tracks.points));
    const std::vector<float> values = visibility.as_float();
    for (size_t i = 0; i < values.size(); ++i) tracks.seen[i] = values[i] > 0.5f;
  }
  for (size_t i = 0; i < tracks.seen.size(); ++i)
    for (size_t axis = 0; axis < 2; ++axis)
      if (!(std::fabs(tracks.xy[2 * i + axis]) < farthest_place)) tracks.seen[i] = 0;
  return tracks;
}

TargetFlow flow_of_points(const PointTracks& tracks, size_t from, size_t to, int width, int height,
                          float sx, float sy) {
  TargetFlow target_flow{zero_flow(width, height), {}};
  const size_t pixels = target_flow.flow.valid.size();
  std::fill(target_flow.flow.valid.begin(), target_flow.flow.valid.end(), uint8_t{0});
  target_flow.confidence.resize(pixels);
  std::map<size_t, float> from_centre;  // distance of the chosen point, by pixel
  for (size_t k = 0; k < tracks.points; ++k) {
    const size_t a = from * tracks.points + k, b = to * tracks.points + k;
    if (!tracks.seen[a] || !tracks.seen[b]) continue;
    const float x = sx * tracks.xy[2 * a], y = sy * tracks.xy[2 * a + 1];
    if (!(x >= 0 && y >= 0 && x < float(width) && y < float(height))) continue;
    const float column = std::floor(x), row = std::floor(y);
    const size_t i = size_t(row) * size_t(width) + size_t(column);
    const float distance = std::hypot(x - column - 0.5f, y - row - 0.5f);
    const auto [nearest, is_first] = from_centre.try_emplace(i, distance);
    if (!is_first && nearest->second <= distance) continue;
    nearest->second = distance;
    target_flow.flow.valid[i] = 1;
    target_flow.confidence[i] = 255;
    target_flow.flow.uv[2 * i] = sx * tracks.xy[2 * b] - x;
    target_flow.flow.uv[2 * i + 1] = sy * tracks.xy[2 * b + 1] - y;
  }
  const double known = double(std::max<size_t>(from_centre.size(), 1));
  target_flow.emphasis = float(std::min(double(pixels) / known, most_of_area));
  return target_flow;
}

namespace {

// Number of visible positions. Error if all are outside their camera's images, or all in the first
// pixel, as for coordinates relative to the width.
size_t require_inside(const PointTracks& tracks, const Camera& stored, const std::string& path) {
  size_t in_sight = 0, inside = 0, in_first = 0;
  for (size_t i = 0; i < tracks.seen.size(); ++i) {
    if (!tracks.seen[i]) continue;
    const float x = tracks.xy[2 * i], y = tracks.xy[2 * i + 1];
    ++in_sight;
    inside += x >= 0 && y >= 0 && x < float(stored.width) && y < float(stored.height);
    in_first += x >= 0 && y >= 0 && x <= 1 && y <= 1;
  }
  if (in_sight == 0 || inside > in_first) return in_sight;
  throw Error(
      fmt::format("{}: no point is inside the images of camera {}{}: 'tracks' must be x and y in "
                  "pixels of the stored images, {}x{}",
                  path, stored.name, in_first ? ", except within the first pixel" : "",
                  stored.width, stored.height));
}

}  // namespace

std::vector<FlowStore::Loader> track_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                                           size_t first, const FrameStore& frames,
                                           const std::string& folder) {
  const std::map<int, Film> films = films_of(scene);
  const bool is_file = fs::is_regular_file(folder);
  if (is_file && films.size() > 1)
    throw Error(
        fmt::format("flow.tracks is the file {}, but {} cameras recorded scene '{}': expected a "
                    "folder with one CAMERA.npz per camera",
                    folder, films.size(), scene.name));
  std::map<int, std::shared_ptr<const PointTracks>> tracks_of;  // by track
  size_t in_sight = 0;
  std::vector<FlowStore::Loader> loaders;
  for (size_t i = first; i < pairs.size(); ++i) {
    const FlowPair pair = pairs[i];
    if (pair.next < 0) {
      loaders.emplace_back();
      continue;
    }
    const Frame& frame = scene.train[size_t(pair.frame)];
    const Camera& stored = scene.cameras[size_t(frame.camera)];
    const Camera camera = frames.camera(frame);
    const Film& film = films.at(frame.track);
    std::shared_ptr<const PointTracks>& tracks = tracks_of[frame.track];
    if (!tracks) {
      const std::string path = is_file ? folder : path_below(folder, stored.name + ".npz").string();
      if (!fs::exists(path))
        throw Error(fmt::format("flow.tracks: there are no tracks of camera {}: looked for {}",
                                stored.name, path));
      if (stored.lens.kind != Lens::Kind::none)
        throw Error(
            fmt::format("flow.tracks: the images of camera {} are undistorted on loading, but the "
                        "tracks in {} are not: use images and tracks without lens distortion",
                        stored.name, path));
      tracks = std::make_shared<const PointTracks>(read_point_tracks(path));
      if (int(tracks->frames) != film.count)
        throw Error(fmt::format("{} has tracks over {} frames, but camera {} has {}", path,
                                tracks->frames, stored.name, film.count));
      in_sight += require_inside(*tracks, stored, path);
    }
    loaders.emplace_back([=, tracks = tracks] {
      return flow_of_points(*tracks, size_t(pair.frame - film.first),
                            size_t(pair.next - film.first), camera.width, camera.height,
                            float(camera.width) / float(stored.width),
                            float(camera.height) / float(stored.height));
    });
  }
  if (!tracks_of.empty() && in_sight == 0)
    throw Error(
        fmt::format("{}: no camera has a visible point: 'tracks' has no finite values, or "
                    "'visibility' none above 0.5",
                    folder));
  return loaders;
}

}  // namespace gflow
