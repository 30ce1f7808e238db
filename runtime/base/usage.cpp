// SPDX-License-Identifier: Apache-2.0
#include "runtime/base/usage.hpp"

#include <sys/resource.h>

#include <ctime>
#include <fstream>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace gflow {
namespace {

rusage usage() {
  rusage u{};
  getrusage(RUSAGE_SELF, &u);
  return u;
}

double seconds(const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); }

}  // namespace

double cpu_seconds() {
  const rusage u = usage();
  return seconds(u.ru_utime) + seconds(u.ru_stime);
}

double thread_cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

double peak_memory_mib() { return double(usage().ru_maxrss) / 1024; }

void begin_peak_memory() {
#ifdef __GLIBC__
  malloc_trim(0);  // freed memory must not count
#endif
  std::ofstream("/proc/self/clear_refs") << "5";  // proc(5)
}

}  // namespace gflow
