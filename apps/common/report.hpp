// SPDX-License-Identifier: Apache-2.0
// Prints the metrics of an evaluation to the terminal.
#pragma once
#include "optim/eval/evaluation.hpp"

namespace gflow {

// A few lines on stdout; nothing if there are no views.
void print_report(const Evaluation& evaluation);

}  // namespace gflow
