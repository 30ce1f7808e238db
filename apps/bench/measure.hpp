// SPDX-License-Identifier: Apache-2.0
// How often something is timed and what is told of it. CPU time stands beside wall time, because on
// a shared machine only the former says what the work costs.
#pragma once
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "runtime/queue.hpp"

namespace gflow::bench {

// The middle of some values, and where the quarters below and above it begin.
struct Spread {
  double median = 0, low = 0, high = 0;
};
Spread spread_of(std::vector<double> values);

// What a piece of queued work costs.
struct Cost {
  Spread wall_ms, cpu_ms;  // until the queue is empty; of all threads of the process
  std::map<std::string, Spread> kernel_ms;  // on the device, by kernel; with a profiling queue
};

// Runs `work` as often as said after two runs that compile and grow buffers.
Cost cost_of(Queue& queue, int repeats, const std::function<void()>& work);

// Of two, a run of each in turn, so that a machine that slows down slows both.
std::pair<Cost, Cost> costs_in_turn(Queue& queue_a, const std::function<void()>& a, Queue& queue_b,
                                    const std::function<void()>& b, int repeats);

}  // namespace gflow::bench
