// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>

#include "runtime/base/usage.hpp"

// What a call takes of memory at once, more than there was [MiB]. 0 where it cannot be told: where
// the system does not begin a peak anew, and under sanitizers, which keep what was freed.
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
