// SPDX-License-Identifier: Apache-2.0
// Preloaded into gflow (LD_PRELOAD): the time of day jumps back or forth by up to ten years at every call.
// The monotonic clock cannot jump and is unchanged. The second call creates the file CLOCK_REPORT, which shows
// that time has gone back at least once.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static time_t jump(void) {
  static atomic_int calls;
  const int n = atomic_fetch_add(&calls, 1);
  const char *report = n == 1 ? getenv("CLOCK_REPORT") : NULL;
  if (report) close(open(report, O_CREAT | O_WRONLY, 0644));
  return (n % 2 ? 1 : -1) * (time_t)(n * 7919 % 3652 + 1) * 86400;
}

int clock_gettime(clockid_t clock, struct timespec *at) {
  const int result = NEXT(clock_gettime)(clock, at);
  if (result == 0 && clock == CLOCK_REALTIME) at->tv_sec += jump();
  return result;
}
time_t time(time_t *at) {
  const time_t now = NEXT(time)(NULL) + jump();
  if (at) *at = now;
  return now;
}
int gettimeofday(struct timeval *restrict at, void *restrict zone) {
  const int result = NEXT(gettimeofday)(at, zone);
  if (result == 0) at->tv_sec += jump();
  return result;
}
