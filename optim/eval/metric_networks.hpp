// SPDX-License-Identifier: Apache-2.0
// The networks of metrics.lpips and metrics.clip.
#pragma once
#include <optional>

#include "optim/eval/evaluation.hpp"
#include "optim/loss/metrics.hpp"
#include "optim/networks/perceptual.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

class MetricNetworks {
 public:
  // Loads the networks; none if the setting is empty. Error if one cannot be used.
  explicit MetricNetworks(const MetricsOptions& config);
  // Error if a network needs another image size.
  void require_size(int width, int height) const;
  // Sets view.lpips and view.clip, each if it has a network.
  void evaluate(ViewMetrics& view, const PlanarImage& image, const PlanarImage& truth);

 private:
  std::optional<Lpips> lpips_;
  std::optional<Clip> clip_;
};

// Makes relative file names absolute, from the working directory.
void make_paths_absolute(MetricsOptions& config);

}  // namespace gflow
