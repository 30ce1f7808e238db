// SPDX-License-Identifier: Apache-2.0
// Writes the report of a run into its folder.
#pragma once
#include <string>
#include <vector>

#include "optim/runs/run_folder.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow::report {

// Writes report.html: metrics of `evaluation`, which is of views of the split, and a few of its
// views, which are rendered here. version: the program's. notices: what the training said, if
// known; what is known of the scene is added. Returns the path, or "" after a warning: a report
// that cannot be written takes nothing from the run.
std::string write_run_report(Queue& queue, const RunFolder& run, const Evaluation& evaluation,
                             const std::string& split, const std::string& version,
                             const std::vector<std::string>& notices = {});

}  // namespace gflow::report
