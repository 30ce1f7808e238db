// SPDX-License-Identifier: Apache-2.0
// Repeated measurements. CPU time is reported beside wall time, because on a shared machine only
// CPU time shows what the work costs.
#pragma once
#include <functional>
#include <utility>

#include "apps/bench/measure/samples.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow::bench {

// The cost of queued work.
struct Cost {
  Samples wall_ms, cpu_ms;  // until the queue is empty; CPU time of all threads of the process
  KernelSamples kernel_ms;  // on the device; needs a profiling queue
};

// Adds the kernel times since the queue's reset, divided by `runs`, as one more repeat. A kernel
// that does not run in every repeat has 0 in the others.
void append_kernels(KernelSamples& kernels, Queue& queue, size_t repeat, int runs);

// Runs `work` `repeats` times, after two warm-up runs that compile kernels and grow buffers.
Cost cost_of(Queue& queue, int repeats, const std::function<void()>& work);

// The same for two pieces of work, alternating in each repeat.
std::pair<Cost, Cost> costs_in_turn(Queue& queue_a, const std::function<void()>& a, Queue& queue_b,
                                    const std::function<void()>& b, int repeats);

}  // namespace gflow::bench
