// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>

#include "runtime/base/usage.hpp"

// Peak memory of a call above the memory before it [MiB]. 0 where it cannot be measured: where the
// system cannot reset the peak, and under sanitizers, which keep freed memory.
inline double memory_of(const std::function<void()>& call) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  call();
  return 0;
#else
  gflow::begin_peak_memory();
  const double before = gflow::peak_memory_mib();
  call();
  return gflow::peak_memory_mib() - before;
#endif
}
