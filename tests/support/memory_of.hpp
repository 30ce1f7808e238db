// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <malloc.h>

#include <functional>

#include "runtime/base/usage.hpp"

// Peak memory of a call above the memory before it [MiB]. 0 where it cannot be measured: where the
// system cannot reset the peak, and under sanitizers, which keep freed memory.
inline double memory_of(const std::function<void()>& call) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  call();
  return 0;
#else
  malloc_trim(0);
  gflow::begin_peak_memory();
  const double before = gflow::peak_memory_mib();
  call();
  return gflow::peak_memory_mib() - before;
#endif
}

// The same as in a fresh process: large blocks that earlier tests have freed make malloc take later
// ones from the heap, where a growing vector leaves holes.
inline double memory_of_first(const std::function<void()>& call) {
  mallopt(M_MMAP_THRESHOLD, 128 << 10);
  const double mib = memory_of(call);
  mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest to which it grows by itself
  return mib;
}
