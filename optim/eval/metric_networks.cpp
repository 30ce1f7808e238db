// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/metric_networks.hpp"

#include <filesystem>

namespace gflow {
namespace {

ColourPlanes planes_of(const PlanarImage& image) {
  return {image.width, image.height, {image.values.begin(), image.values.end()}};
}

}  // namespace

MetricNetworks::MetricNetworks(const MetricsOptions& config) {
  if (!config.lpips.empty()) lpips_.emplace(config.lpips, "metrics.lpips");
  if (!config.clip.empty()) clip_.emplace(config.clip, "metrics.clip");
}

void MetricNetworks::require_size(int width, int height) const {
  if (lpips_) lpips_->require_size(width, height);
}

void MetricNetworks::evaluate(ViewMetrics& view, const PlanarImage& image,
                              const PlanarImage& truth) {
  if (!lpips_ && !clip_) return;
  const ColourPlanes drawn = planes_of(image), filmed = planes_of(truth);
  if (lpips_) view.lpips = lpips_->distance(drawn, filmed);
  if (clip_) view.clip = clip_->similarity(drawn, filmed);
}

void make_paths_absolute(MetricsOptions& config) {
  for (std::string* path : {&config.lpips, &config.clip})
    if (!path->empty()) *path = std::filesystem::absolute(*path).lexically_normal().string();
}

}  // namespace gflow
