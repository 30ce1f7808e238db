// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/guidance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

bool is_weight(float value) { return std::isfinite(value) && value >= 0; }

}  // namespace

void require_usable(const GuidanceRequest& request, const std::vector<GuidanceAnswer>& answers,
                    const std::string& provider) {
  const auto refuse = [&](const std::string& what) {
    throw GuidanceFailed(fmt::format("{} answered step {} with {}", provider, request.step, what));
  };
  if (answers.size() != request.views.size())
    refuse(fmt::format("{} views, expected {}", answers.size(), request.views.size()));
  for (size_t i = 0; i < answers.size(); ++i) {
    const GuidanceAnswer& answer = answers[i];
    const Camera& camera = request.views[i].camera;
    const size_t pixels = size_t(camera.width) * size_t(camera.height);
    const auto require_size = [&](const char* what, size_t size, size_t planes) {
      if (size != 0 && size != planes * pixels)
        refuse(fmt::format("a {} of {} values for view {}, expected {} x {} x {} = {}", what, size,
                           i, planes, camera.height, camera.width, planes * pixels));
    };
    require_size("gradient", answer.gradient.size(), 3);
    require_size("flow", answer.flow.size(), 2);
    require_size("confidence", answer.confidence.size(), 1);
    if (!is_weight(answer.weight) || !is_weight(answer.flow_weight))
      refuse(fmt::format("the weights {} and {} for view {}, which must be finite and at least 0",
                         answer.weight, answer.flow_weight, i));
    if (!std::all_of(answer.gradient.begin(), answer.gradient.end(),
                     [](float v) { return std::isfinite(v); }))
      refuse(fmt::format("a gradient for view {} that contains NaN or Inf", i));
  }
}

}  // namespace gflow
