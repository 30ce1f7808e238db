// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/held_back.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Of `count` things the places of every n-th, not the first.
std::set<size_t> every_nth(size_t count, size_t n) {
  std::set<size_t> places;
  for (size_t i = n - 1; i < count; i += n) places.insert(i);
  if (places.empty() && count >= 3) places.insert(count / 2);
  return places;
}

// Whether each training frame is held back.
std::vector<bool> held_back(const Scene& scene, size_t n) {
  std::set<int> all;
  for (const Frame& frame : scene.train) all.insert(frame.track);
  const std::vector<int> tracks(all.begin(), all.end());
  std::vector<bool> held(scene.train.size());
  if (tracks.size() > 1) {
    std::set<int> chosen;
    for (const size_t place : every_nth(tracks.size(), n)) chosen.insert(tracks[place]);
    for (size_t i = 0; i < held.size(); ++i) held[i] = chosen.count(scene.train[i].track) > 0;
  } else {
    std::vector<size_t> by_time(held.size());
    for (size_t i = 0; i < by_time.size(); ++i) by_time[i] = i;
    std::stable_sort(by_time.begin(), by_time.end(),
                     [&](size_t a, size_t b) { return scene.train[a].time < scene.train[b].time; });
    for (const size_t place : every_nth(by_time.size(), n)) held[by_time[place]] = true;
  }
  return held;
}

}  // namespace

void hold_back(Scene& scene, int n) {
  if (n == 0) return;
  const std::vector<bool> held = held_back(scene, size_t(n));
  if (std::find(held.begin(), held.end(), true) == held.end())
    throw Error(
        fmt::format("scene.val_every = {}: scene '{}' has too few training views to hold one back",
                    n, scene.name));
  const size_t steps = distinct_times(scene.train).size();
  int first_track = 0;  // tracks are numbered within their split
  for (const Frame& frame : scene.val) first_track = std::max(first_track, frame.track + 1);
  std::vector<Frame> rest;
  for (size_t i = 0; i < held.size(); ++i) {
    Frame frame = scene.train[i];
    if (held[i]) frame.track += first_track;
    (held[i] ? scene.val : rest).push_back(std::move(frame));
  }
  scene.train = std::move(rest);
  const std::vector<double> times = distinct_times(scene.train);
  if (times.size() == steps || scene.steps == 0) return;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    set_steps(times, *split);
  scene.steps = int(times.size());
  scene.tracks_path.clear();  // tracks cover all steps, also those held back
}

}  // namespace gflow
