// SPDX-License-Identifier: Apache-2.0
// How often something is timed and what is told of it. CPU time stands beside wall time, because on
// a shared machine only the former says what the work costs.
#pragma once
#include <functional>
#include <utility>

#include "apps/bench/samples.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow::bench {

// What a piece of queued work costs.
struct Cost {
  Samples wall_ms, cpu_ms;  // until the queue is empty; of all threads of the process
  KernelSamples kernel_ms;  // on the device; with a profiling queue
};

// Adds what the queue has timed since its reset, a `runs`-th of it, as one more repeat. A kernel
// that does not run in all repeats has 0 in the others.
void append_kernels(KernelSamples& kernels, Queue& queue, size_t repeat, int runs);

// Runs `work` as often as said after two runs that compile and grow buffers.
Cost cost_of(Queue& queue, int repeats, const std::function<void()>& work);

// Of two, a run of each in every repeat.
std::pair<Cost, Cost> costs_in_turn(Queue& queue_a, const std::function<void()>& a, Queue& queue_b,
                                    const std::function<void()>& b, int repeats);

}  // namespace gflow::bench
