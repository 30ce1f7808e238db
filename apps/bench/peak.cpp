// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/peak.hpp"

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>

#include "runtime/cl/kernel.hpp"

namespace gflow::bench {
namespace {

constexpr int kRuns = 9;
constexpr double kChains = 12;  // as in peak.cl

double least_seconds(Queue& queue, const std::function<void()>& work) {
  double least = std::numeric_limits<double>::max();
  work();
  for (int i = 0; i < kRuns; ++i) {
    queue.finish();
    const auto start = std::chrono::steady_clock::now();
    work();
    queue.finish();
    least = std::min(
        least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return least;
}

}  // namespace

Peak measure_peak(Queue& queue) {
  Program program(queue, "checks/peak.cl");
  Kernel<cl_int, cl_float, cl_float, Out<float>> fma(program, "peak_fma");
  Kernel<In<float>, Out<float>> copy(program, "peak_copy");
  // A CPU runs one work-item per core; a GPU needs very many short ones.
  const bool wide = queue.lanes > 1;
  const size_t items = wide ? 4 * queue.info.compute_units : 65536;
  const cl_int rounds = wide ? 1600000 : 4096;
  const size_t floats = size_t(8) << 20;  // 32 MiB, read once and written once
  Buffer<float> out(queue, items, "peak sums"), from(queue, floats, "peak from");
  Buffer<float> to(queue, floats, "peak to");
  from.fill(queue, 1.f);
  Peak peak;
  const double seconds = least_seconds(queue, [&] {
    fma(queue, wide ? Range::groups(items, 1) : Range::over(items, 64), rounds, 0.999f, 0.001f,
        out);
  });
  peak.gflops = 2e-9 * kChains * queue.lanes * double(rounds) * double(items) / seconds;
  const double copied =
      least_seconds(queue, [&] { copy(queue, Range::over(floats / 16, 256), from, to); });
  peak.copy_gbs = 1e-9 * 2 * double(floats * sizeof(float)) / copied;
  return peak;
}

}  // namespace gflow::bench
