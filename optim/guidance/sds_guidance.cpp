// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/sds_guidance.hpp"

#include <utility>

#include "optim/guidance/analytic.hpp"

namespace gflow {

SdsGuidance::SdsGuidance(std::unique_ptr<Denoiser> denoiser, NoiseSchedule schedule, SdsRule rule)
    : denoiser_(std::move(denoiser)), schedule_(std::move(schedule)), rule_(rule) {}

std::vector<GuidanceAnswer> SdsGuidance::guide(const GuidanceRequest& request) {
  std::vector<GuidanceAnswer> answers(request.views.size());
  for (size_t i = 0; i < answers.size(); ++i) {
    const GuidanceView& view = request.views[i];
    const int timestep =
        timestep_at(schedule_, timestep_share(rule_, request.progress, request.seed, uint32_t(i)));
    const std::vector<float> noise = gaussian_noise(request.seed, uint32_t(i), view.rgb.size());
    answers[i].gradient =
        sds_gradient(*denoiser_, schedule_, request, view, timestep, noise, rule_.scale);
  }
  return answers;
}

AnalyticGuidance::AnalyticGuidance(const std::string& folder, double variance,
                                   NoiseSchedule schedule, SdsRule rule)
    : views_(folder),
      sds_(std::make_unique<AnalyticDenoiser>(views_, variance), std::move(schedule), rule) {}

std::vector<GuidanceAnswer> AnalyticGuidance::guide(const GuidanceRequest& request) {
  std::vector<GuidanceAnswer> answers = sds_.guide(request);
  if (!request.wants_flow) return answers;
  for (size_t i = 0; i < answers.size(); ++i) {
    const auto known = views_.flow(request, request.views[i]);
    if (!known) continue;
    const size_t pixels = known->confidence.size();
    answers[i].confidence = known->confidence;
    answers[i].flow.resize(2 * pixels);
    for (size_t p = 0; p < pixels; ++p)
      for (size_t c = 0; c < 2; ++c) answers[i].flow[c * pixels + p] = known->flow.uv[2 * p + c];
  }
  return answers;
}

}  // namespace gflow
