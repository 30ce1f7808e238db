// SPDX-License-Identifier: Apache-2.0
// Loops over several threads of the host.
#pragma once
#include <algorithm>
#include <atomic>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace gflow {

// Cores of the machine, at least 1.
inline size_t num_cores() { return std::max(1u, std::thread::hardware_concurrency()); }

// Runs work(i) for i in 0..n-1 on several threads including this one; with fewer if the system
// grants no more. The first exception stops the work and is rethrown here.
inline void for_each_parallel(size_t n, size_t threads, const std::function<void(size_t)>& work) {
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::exception_ptr first;
  const auto run = [&] {
    for (size_t i; (i = next++) < n;) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!first) first = std::current_exception();
        next = n;
      }
    }
  };
  std::vector<std::thread> workers;
  try {
    for (size_t t = 1; t < std::min(threads, n); ++t) workers.emplace_back(run);
  } catch (const std::exception&) {  // std::system_error or out of memory
  }
  run();
  for (std::thread& worker : workers) worker.join();
  if (first) std::rethrow_exception(first);
}

}  // namespace gflow
