// SPDX-License-Identifier: Apache-2.0
#include "apps/experiments/metrics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow::experiments {

const std::vector<Metric>& all_metrics() {
  static const std::vector<Metric> metrics{
      {"psnr", "PSNR [dB]", {"test", "psnr"}, 2, Better::higher},
      {"psnr_matched", "PSNR, colours matched [dB]", {"test", "psnr_matched"}, 2, Better::higher},
      {"ssim", "SSIM", {"test", "ssim"}, 4, Better::higher},
      {"lpips", "LPIPS", {"test", "lpips"}, 4, Better::lower, 1, "lpips_model"},
      {"clip", "CLIP", {"test", "clip"}, 4, Better::higher, 1, "clip_model"},
      {"psnr_dynamic", "PSNR, moving [dB]", {"test", "psnr_dynamic"}, 2, Better::higher},
      {"ssim_dynamic", "SSIM, moving", {"test", "ssim_dynamic"}, 4, Better::higher},
      {"flow_epe", "flow error [px]", {"test", "flow_epe"}, 3, Better::lower},
      {"flow_epe_dynamic",
       "flow error, moving [px]",
       {"test", "flow_epe_dynamic"},
       3,
       Better::lower},
      {"teacher_epe_dynamic",
       "target flow error [px]",
       {"test", "teacher_epe_dynamic"},
       3,
       Better::neither},
      {"fl_all", "Fl-all [%]", {"test", "fl_all"}, 2, Better::lower, 100},
      {"track_error", "3D track error", {"test", "tracks", "mean"}, 4, Better::lower},
      {"track_from_view",
       "3D track error from the view",
       {"test", "tracks", "from_view"},
       4,
       Better::lower},
      {"track_end", "3D track error at the end", {"test", "tracks", "end"}, 4, Better::lower},
      {"motion_error", "3D motion error", {"test", "tracks", "motion"}, 4, Better::lower},
      {"track_error_seen",
       "3D track error, seen",
       {"test", "tracks", "seen", "mean"},
       4,
       Better::lower},
      {"motion_error_seen",
       "3D motion error, seen",
       {"test", "tracks", "seen", "motion"},
       4,
       Better::lower},
      {"depth_error", "depth error [%]", {"test", "depth_error"}, 2, Better::lower, 100},
      {"flicker", "flicker [grey levels]", {"test", "flicker"}, 2, Better::lower},
      {"gaussians", "Gaussians", {"num_gaussians"}, 0, Better::neither},
      {"steps", "steps", {"iterations"}, 0, Better::neither},
      {"minutes", "minutes", {"train_seconds"}, 2, Better::lower, 1. / 60},
      {"memory", "peak memory [MiB]", {"peak_memory_mib"}, 0, Better::lower},
  };
  return metrics;
}

std::vector<std::string> metric_names() {
  std::vector<std::string> names;
  for (const Metric& metric : all_metrics()) names.push_back(metric.name);
  return names;
}

std::optional<std::pair<size_t, size_t>> step_range(const std::string& text) {
  size_t first = 0, last = 0;
  int read = 0;
  if (std::sscanf(text.c_str(), "%4zu-%4zu%n", &first, &last, &read) != 2) return std::nullopt;
  if (size_t(read) != text.size() || first > last) return std::nullopt;
  return std::pair(first, last);
}

Metric metric_named(const std::string& name) {
  const size_t at = name.find('@');
  const std::string whole = name.substr(0, at);
  for (const Metric& metric : all_metrics()) {
    if (whole != metric.name) continue;
    if (at == std::string::npos) return metric;
    const bool of_motion = whole.rfind("motion_error", 0) == 0;
    const bool of_tracks = of_motion || whole.rfind("track_error", 0) == 0;
    const bool of_views = metric.path.size() == 2 && std::string(metric.path[0]) == "test";
    if (!of_tracks && !of_views)
      throw Error("metric '" + excerpt(whole) + "' has no values per time step");
    const auto steps = step_range(name.substr(at + 1));
    if (!steps)
      throw Error("metric '" + excerpt(name) + "' must be NAME@FIRST-LAST, for example psnr@10-12");
    Metric part = metric;
    part.name = name;
    part.label = fmt::format("{}, steps {} to {}", metric.label, steps->first, steps->second);
    if (of_tracks)  // over all points, or over the seen ones
      part.path.back() = of_motion ? "motion_by_step" : "by_step";
    else
      part.path = {"test", "by_step", metric.path[1]};
    part.steps = steps;
    return part;
  }
  throw Error(fmt::format("unknown metric '{}'; known are {}", excerpt(name),
                          fmt::join(metric_names(), ", ")));
}

bool is_repeatable(const Metric& metric) {
  return metric.name != "minutes" && metric.name != "memory";
}

double value_of(const Metric& metric, const nlohmann::json& results) {
  const nlohmann::json* node = &results;
  for (const char* key : metric.path) {
    if (!node->is_object() || !node->contains(key)) return std::numeric_limits<double>::quiet_NaN();
    node = &(*node)[key];
  }
  if (metric.steps) {
    // NaN if steps are missing: the heading promises a mean over all of them.
    if (!node->is_array() || metric.steps->second >= node->size())
      return std::numeric_limits<double>::quiet_NaN();
    double sum = 0;
    size_t count = 0;
    for (size_t k = metric.steps->first; k <= metric.steps->second; ++k) {
      if (!(*node)[k].is_number()) continue;
      sum += (*node)[k].get<double>() * metric.scale;
      ++count;
    }
    return count ? sum / double(count) : std::numeric_limits<double>::quiet_NaN();
  }
  return node->is_number() ? node->get<double>() * metric.scale
                           : std::numeric_limits<double>::quiet_NaN();
}

bool lacks_model(const Metric& metric, const nlohmann::json& results) {
  if (!metric.model || !results.is_object()) return false;
  const auto test = results.find("test");
  if (test == results.end() || !test->is_object()) return false;
  const auto model = test->find(metric.model);
  return model != test->end() && model->is_null();
}

}  // namespace gflow::experiments
