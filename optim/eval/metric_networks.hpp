// SPDX-License-Identifier: Apache-2.0
// The networks that the settings name to judge pictures by (metrics.lpips, metrics.clip).
#pragma once
#include <optional>

#include "optim/eval/evaluation.hpp"
#include "optim/loss/metrics.hpp"
#include "optim/networks/perceptual.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

class MetricNetworks {
 public:
  // Loads them; none where the setting is empty. Error when one cannot be used.
  explicit MetricNetworks(const MetricsOptions& config);
  // Error when one takes pictures of another size.
  void require_size(int width, int height) const;
  // Sets view.lpips and view.clip, each where it has a network.
  void evaluate(ViewMetrics& view, const Picture& picture, const Picture& truth);

 private:
  std::optional<Lpips> lpips_;
  std::optional<Clip> clip_;
};

// Names of files that are relative to where gflow was started, made independent of it.
void make_paths_absolute(MetricsOptions& config);

}  // namespace gflow
