// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/camera_settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace {

constexpr double same_time = 1e-9;  // [video durations]

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") + 1 - first);
}

// Indices of the cameras of a name: a moving camera has one for each pose. Error if there is none.
std::vector<size_t> cameras_named(const std::vector<Camera>& cameras, const std::string& name,
                                  const char* setting) {
  // Names of cameras are paths of images in some layouts: images_cam03, cam03.jpg.
  const auto bare = [](const std::string& text) {
    std::string plain = without_image_extension(with_slashes(text));
    std::replace(plain.begin(), plain.end(), '/', '_');
    return plain;
  };
  const std::string wanted = bare(name), ending = "_" + wanted;
  std::vector<size_t> found, ended;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const std::string own = bare(cameras[i].name);
    if (own == wanted) found.push_back(i);
    if (own.size() > ending.size() &&
        own.compare(own.size() - ending.size(), ending.size(), ending) == 0)
      ended.push_back(i);
  }
  if (!found.empty()) return found;
  if (!ended.empty()) return ended;
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  throw Error(fmt::format("{} names camera '{}', but the scene has {}", setting, excerpt(name),
                          short_list(names, 20)));
}

double offset_of(const std::string& text, const std::string& entry) {
  const char *begin = text.data(), *end = begin + text.size();
  if (begin != end && *begin == '+') ++begin;
  double offset = 0;
  const auto read = std::from_chars(begin, end, offset);
  if (read.ec != std::errc() || read.ptr != end || !std::isfinite(offset))
    throw Error(fmt::format("scene.time_offsets has '{}', expected NAME=NUMBER", excerpt(entry)));
  return offset;
}

}  // namespace

std::vector<std::string> entries_of(const std::string& list) {
  std::vector<std::string> entries;
  for (size_t at = 0; at <= list.size();) {
    const size_t end = std::min(list.find(',', at), list.size());
    const std::string entry = trimmed(list.substr(at, end - at));
    if (!entry.empty()) entries.push_back(entry);
    at = end + 1;
  }
  return entries;
}

std::vector<bool> skipped_cameras(const std::vector<Camera>& cameras, const std::string& list) {
  std::vector<bool> skipped(cameras.size());
  for (const std::string& name : entries_of(list))
    for (const size_t i : cameras_named(cameras, name, "scene.skip_cameras")) skipped[i] = true;
  if (!cameras.empty() && std::find(skipped.begin(), skipped.end(), false) == skipped.end())
    throw Error("scene.skip_cameras leaves no camera of the scene");
  return skipped;
}

void skip_cameras(Scene& scene, const std::string& list) {
  if (entries_of(list).empty()) return;
  const std::vector<bool> skipped = skipped_cameras(scene.cameras, list);
  std::vector<Camera> cameras;
  std::vector<int> places;
  for (size_t i = 0; i < skipped.size(); ++i) {
    places.push_back(int(cameras.size()));
    if (!skipped[i]) cameras.push_back(scene.cameras[i]);
  }
  scene.cameras = cameras;
  const size_t steps = distinct_times(scene.train).size();
  const bool had_tests = !scene.test.empty();
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val}) {
    split->erase(std::remove_if(split->begin(), split->end(),
                                [&](const Frame& frame) { return skipped[size_t(frame.camera)]; }),
                 split->end());
    for (Frame& frame : *split) frame.camera = places[size_t(frame.camera)];
  }
  if (scene.train.empty()) throw Error("scene.skip_cameras leaves no training images");
  if (had_tests && scene.test.empty())
    scene.notices.push_back("scene.skip_cameras leaves no test views");
  const std::vector<double> times = distinct_times(scene.train);
  if (times.size() == steps) return;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    set_steps(times, *split);
  scene.steps = int(times.size());
  scene.tracks_path.clear();  // tracks cover all steps, also those dropped
}

void shift_times(Scene& scene, const std::string& list) {
  const std::vector<std::string> entries = entries_of(list);
  if (entries.empty()) return;
  const std::vector<double> times = distinct_times(scene.train);
  if (times.size() < 2) throw Error("scene.time_offsets needs a scene with two time steps or more");
  const double first = times.front(), last = times.back();
  const double interval = (last - first) / double(times.size() - 1);
  std::vector<double> shifts(scene.cameras.size());
  for (const std::string& entry : entries) {
    const size_t equals = std::min(entry.rfind('='), entry.size());
    const double offset =
        offset_of(trimmed(entry.substr(std::min(equals + 1, entry.size()))), entry);
    const std::string name = trimmed(entry.substr(0, equals));
    for (const size_t i : cameras_named(scene.cameras, name, "scene.time_offsets"))
      shifts[i] = offset * interval;
  }
  std::vector<int> steps(times.size());  // of these times
  for (const Frame& frame : scene.train) steps[nearest_time(times, frame.time)] = frame.step;
  size_t dropped = 0;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val}) {
    std::vector<Frame> kept;
    for (Frame& frame : *split) {
      const double shift = shifts[size_t(frame.camera)];
      if (shift != 0) {
        frame.time += shift;
        if (!frame.flow_path.empty()) frame.flow_time += shift;
        if (frame.time < first - same_time || frame.time > last + same_time) continue;
        const size_t nearest = nearest_time(times, frame.time);
        frame.step = steps[nearest];
        if (std::fabs(frame.time - times[nearest]) < same_time) frame.time = times[nearest];
      }
      kept.push_back(frame);
    }
    dropped += split->size() - kept.size();
    *split = std::move(kept);
  }
  if (scene.train.empty()) throw Error("scene.time_offsets leaves no training images");
  if (dropped > 0)
    scene.notices.push_back(fmt::format(
        "{} frames are left out: scene.time_offsets moves them out of the video", dropped));
}

}  // namespace gflow
