// SPDX-License-Identifier: Apache-2.0
// Score distillation with any denoiser, by the schedule and rule of sds.hpp.
#pragma once
#include <memory>

#include "optim/guidance/known_views.hpp"
#include "optim/guidance/sds.hpp"

namespace gflow {

class SdsGuidance : public Guidance {
 public:
  SdsGuidance(std::unique_ptr<Denoiser> denoiser, NoiseSchedule schedule, SdsRule rule);
  std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) override;
  std::string name() const override { return denoiser_->name(); }

 private:
  std::unique_ptr<Denoiser> denoiser_;
  NoiseSchedule schedule_;
  SdsRule rule_;
};

// Score distillation with images, and optionally flows, of a folder (analytic.hpp).
class AnalyticGuidance : public Guidance {
 public:
  AnalyticGuidance(const std::string& folder, double variance, NoiseSchedule schedule,
                   SdsRule rule);
  std::vector<GuidanceAnswer> guide(const GuidanceRequest& request) override;
  std::string name() const override { return sds_.name(); }

 private:
  KnownViews views_;
  SdsGuidance sds_;
};

}  // namespace gflow
