// SPDX-License-Identifier: Apache-2.0
#include "apps/experiments/metrics.hpp"

#include <cmath>
#include <limits>

#include "runtime/error.hpp"

namespace gflow::experiments {

const std::vector<Metric>& all_metrics() {
  static const std::vector<Metric> metrics{
      {"psnr", "PSNR [dB]", {"test", "psnr"}, 2, Better::higher},
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
       "DIS there [px]",
       {"test", "teacher_epe_dynamic"},
       3,
       Better::neither},
      {"fl_all", "Fl-all [%]", {"test", "fl_all"}, 2, Better::lower, 100},
      {"track_error", "3D track error", {"test", "tracks", "mean"}, 4, Better::lower},
      {"track_end", "3D track error at the end", {"test", "tracks", "end"}, 4, Better::lower},
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

const Metric& metric_named(const std::string& name) {
  for (const Metric& metric : all_metrics())
    if (name == metric.name) return metric;
  throw Error("there is no metric '" + name + "'");
}

bool is_repeatable(const Metric& metric) {
  return std::string(metric.name) != "minutes" && std::string(metric.name) != "memory";
}

double value_of(const Metric& metric, const nlohmann::json& results) {
  const nlohmann::json* node = &results;
  for (const char* key : metric.path) {
    if (!node->is_object() || !node->contains(key)) return std::numeric_limits<double>::quiet_NaN();
    node = &(*node)[key];
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
