// SPDX-License-Identifier: Apache-2.0
// Preloaded into gflow (LD_PRELOAD): threads cannot be created, as under a container's limit.
//   FAULT_THREAD  k, from 1: creating the k-th thread of the program and all later ones fails
//   FAULT_REPORT  file that gets a line for each failure
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

static atomic_long made;

int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*run)(void *), void *with) {
  const char *from = getenv("FAULT_THREAD"), *to = getenv("FAULT_REPORT");
  int (*next)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *) =
      (__typeof__(&pthread_create))dlsym(RTLD_NEXT, "pthread_create");
  if (!from || atomic_fetch_add(&made, 1) + 1 < atol(from)) return next(thread, how, run, with);
  const int report = to ? open(to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600) : -1;
  if (report >= 0 && write(report, "failed\n", 7) != 7) _exit(99);
  if (report >= 0) close(report);
  return EAGAIN;
}
