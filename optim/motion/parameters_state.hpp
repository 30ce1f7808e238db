// SPDX-License-Identifier: Apache-2.0
// Parameters in checkpoints: everything that a later training step reads.
#pragma once
#include <limits>
#include <string>

#include "optim/formats/npz.hpp"
#include "optim/motion/models.hpp"

namespace gflow {

// Adds, for each group of each table, TABLE/GROUP, TABLE/GROUP/exp_avg if it is kept, and
// TABLE/GROUP/exp_avg_sq [rows, width]; for each table TABLE/rows/steps, last, rejected, rate_scale
// and rate_divisor [rows] and TABLE/rows/now [1]; and gaussians/moving [1], the number of dynamic
// Gaussians. TABLE is gaussians, table1, table2 and so on. Gradients and seen marks are not saved:
// they belong to one step. Waits.
void save_state(Queue& queue, const Parameters& parameters, Arrays& arrays);

// The reverse; sets the number of Gaussians to that of the arrays. Error that names the array if
// one is missing or has another type or shape; then nothing is changed. `path`: the file, for
// messages.
void load_state(Queue& queue, Parameters& parameters, const Arrays& arrays,
                const std::string& path);

// Name of the first array with a value that no training produces: non-finite; a second moment,
// rate_scale or density-control count below 0; a rate_scale above PaceRule::kMost; a rate_divisor
// that is not above 0; a step count above the range of int; or a table with more than `steps`
// steps. Two names if two arrays contradict each other. Empty if there is none.
std::string non_finite_array(const Arrays& arrays,
                             uint32_t steps = uint32_t(std::numeric_limits<int>::max()));

// The values alone, by group, without a device. Groups with GroupSpec::moving have rows for the
// first `moving` Gaussians only. Error as load_state.
struct StateValues {
  size_t count = 0, moving = 0;
  HostGroups groups;
};
StateValues state_values(const Arrays& arrays, const std::vector<GroupSpec>& specs,
                         const std::vector<TableSpec>& more_specs, const std::string& path);

}  // namespace gflow
