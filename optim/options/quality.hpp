// SPDX-License-Identifier: Apache-2.0
// One dial for how long to train: --quality of `gflow train`, `quality` of an experiment.
#pragma once
#include <array>
#include <string>

#include "optim/options/train_options.hpp"

namespace gflow {

constexpr std::array<const char*, 3> kQualities{"draft", "standard", "best"};

// Sets train.iterations. Throws Error for another word.
void apply_quality(TrainOptions& config, const std::string& word);

}  // namespace gflow
