// SPDX-License-Identifier: Apache-2.0
// What a checkpoint keeps of parameters: everything that a later training step reads.
#pragma once
#include <limits>
#include <string>

#include "optim/formats/npz.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// Adds for each group of each table TABLE/GROUP, TABLE/GROUP/exp_avg where it is kept and
// TABLE/GROUP/exp_avg_sq [rows, width], and of the rows TABLE/rows/steps, refused, pace and reach
// [rows]. TABLE is gaussians, table1, table2 and so on. And gaussians/moving [1], how many move.
// Gradients and what was seen are a step's own. Waits.
void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays);

// The reverse; the number of Gaussians becomes that of the arrays. Error that names the array when
// one is missing or has another type or shape; then nothing is changed. `path`: the file, for
// messages.
void load_state(Queue& queue, Parameters& parameters, const Arrays& arrays,
                const std::string& path);

// Of such arrays the first with what no training may leave, by name: a value that is not finite, a
// second moment, a pace or a count of density control below 0, a pace above PaceRule::kMost, a
// reach that is not above 0, more steps than an int counts, or a table that is further than the
// `steps` of its training; two names where they contradict each other. Empty when there is none.
std::string non_finite_array(const Arrays& arrays,
                             uint32_t steps = uint32_t(std::numeric_limits<int>::max()));

// The values alone, by group, read without a device: in groups of what moves, the rows of those
// that do, which are the first `moving` of all. Error as load_state.
struct StateValues {
  size_t count = 0, moving = 0;
  HostGroups groups;
};
StateValues state_values(const Arrays& arrays, const std::vector<GroupSpec>& specs,
                         const std::vector<TableSpec>& more_specs, const std::string& path);

}  // namespace gflow
