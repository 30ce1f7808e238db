// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/times_by_order.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <set>

#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Folder and name before the number.
std::string video_of(const std::string& path) {
  return join(std::filesystem::path(path).parent_path().string(), split_number(stem(path)).prefix);
}

}  // namespace

std::vector<double> times_of_names(const std::vector<std::string>& names) {
  std::vector<double> times;
  for (const std::string& name : names) times.push_back(std::stod(split_number(stem(name)).number));
  const double first = times[0], last = times.back();
  const bool rise =
      std::adjacent_find(times.begin(), times.end(), std::greater_equal<>()) == times.end() &&
      std::isfinite(last);
  for (size_t k = 0; k < times.size(); ++k)
    times[k] = times.size() < 2 ? 0
               : rise           ? (times[k] - first) / (last - first)
                                : double(k) / double(times.size() - 1);
  return times;
}

void set_times_by_order(std::vector<Frame>& frames, const std::string& source) {
  double first = std::numeric_limits<double>::max(), last = 0;
  std::map<std::string, int> tracks;
  for (Frame& frame : frames) {
    const std::string number = split_number(stem(frame.path)).number;
    frame.time = number.empty() ? NAN : std::stod(number);
    if (!std::isfinite(frame.time))
      throw Error(
          fmt::format("scene.times is \"order\", but image {} of {} has no number at the "
                      "end of its name",
                      frame.path, source));
    frame.track = tracks.emplace(video_of(frame.path), int(tracks.size())).first->second;
    first = std::min(first, frame.time);
    last = std::max(last, frame.time);
  }
  for (Frame& frame : frames) frame.time = last > first ? (frame.time - first) / (last - first) : 0;
}

void report_video_names(const std::vector<Frame>& frames, const std::string& source,
                        std::vector<std::string>& notices) {
  constexpr size_t few = 8;  // photographs have numbers, too
  std::set<std::string> videos;
  for (const Frame& frame : frames) {
    const Numbered name = split_number(stem(frame.path));
    if (name.number.empty() || name.prefix.rfind("cam", 0) == 0) return;  // one image per camera
    videos.insert(video_of(frame.path));
  }
  if (frames.size() < few * std::max<size_t>(1, videos.size())) return;
  notices.push_back(
      fmt::format("the images of {} have no times, so the scene is taken to be static; if they are "
                  "frames of a video of something that moves, use --set scene.times=order",
                  source));
}

}  // namespace gflow
