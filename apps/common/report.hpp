// SPDX-License-Identifier: Apache-2.0
// The metrics of an evaluation as a table on stdout.
#pragma once
#include "optim/eval/evaluation.hpp"
#include "optim/runs/run_folder.hpp"

namespace gflow {

// One row per measured metric, then facts of the run that are known; nothing if there are no views.
void print_report(const Evaluation& evaluation, const RunFacts& facts);

}  // namespace gflow
