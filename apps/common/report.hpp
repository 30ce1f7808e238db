// SPDX-License-Identifier: Apache-2.0
// How figures of an evaluation are shown on the terminal.
#pragma once
#include "optim/eval/evaluation.hpp"

namespace gflow {

// A few lines on stdout; nothing when there were no views.
void print_report(const Evaluation& evaluation);

}  // namespace gflow
