// SPDX-License-Identifier: Apache-2.0
// Numbers of a model with fewer digits, for files that are to be small.
#pragma once
#include "optim/engine/settings.hpp"
#include "optim/eval/views.hpp"
#include "optim/model/model.hpp"

namespace gflow {

// The model with its numbers rounded to multiples of powers of two that move, turn or colour a
// Gaussian by what is hardly seen: zero bits compress. Motion that Gaussians share stays as it is.
HostModel rounded_model(const HostModel& model);

// PSNR of all pixels of another model's pictures, with the model's as the truth [dB]; infinite if
// they are equal. `near` [scene units].
double psnr_between(Queue& queue, const HostModel& other, const HostModel& model,
                    const std::vector<RenderView>& views, const EngineSettings& settings,
                    double near);

}  // namespace gflow
