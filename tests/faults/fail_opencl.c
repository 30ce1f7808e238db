// SPDX-License-Identifier: Apache-2.0
// Preloaded into gflow (LD_PRELOAD): the k-th OpenCL call of some kinds fails, or all from the k-th on (a lost
// device), and a device may report less memory than it has.
//   CLFAULT_KINDS    kinds that count, e.g. "create" or "launch,copy"; see KINDS below
//   CLFAULT_CALL     k, from 1; 0: no call fails
//   CLFAULT_LAST     the last call that fails (default: k)
//   CLFAULT_CODE     its return value, e.g. -4; 1: it never returns
//   CLFAULT_LARGEST  CL_DEVICE_MAX_MEM_ALLOC_SIZE [bytes]; CLFAULT_MEMORY: CL_DEVICE_GLOBAL_MEM_SIZE
//   CLFAULT_REPORT   file that gets a line per counted call: its number, "failed" or "made", its name. At exit,
//                    unless by quick_exit (a device that hangs) or kill, a line "0 left COUNT KIND" for
//                    objects that were not released
// KINDS: setup (context, queue), build (program of a source, building of any), binary (program of a
// binary, binaries of a program), kernel, argument, create (buffers), launch, copy (read, write, map,
// copy, fill), wait (finish, events), flush.
// A failing wait waits first: otherwise memory would be freed while the device writes to it. A failing build is
// tried first: otherwise the driver has no build log and reports an invalid program.
#define _GNU_SOURCE
#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#include <CL/cl.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static atomic_long calls;
static const char *kinds = "";
static long first, last;
static cl_int code;
static int report = -1;

// Live objects of each kind: created and retained minus released.
enum object { CONTEXT, QUEUE, PROGRAM, KERNEL, BUFFER, EVENT, NOTHING };
static const char *objects[] = {"context", "queue", "program", "kernel", "buffer", "event"};
static atomic_long alive[NOTHING + 1];

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static long number(const char *name, long otherwise) {
  const char *text = getenv(name);
  return text ? atol(text) : otherwise;
}

__attribute__((constructor)) static void start(void) {
  const char *to = getenv("CLFAULT_REPORT");
  if (getenv("CLFAULT_KINDS")) kinds = getenv("CLFAULT_KINDS");
  first = number("CLFAULT_CALL", 0);
  last = number("CLFAULT_LAST", first);
  code = (cl_int)number("CLFAULT_CODE", CL_OUT_OF_RESOURCES);
  if (to) report = open(to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
}

__attribute__((destructor)) static void end(void) {
  for (int kind = 0; kind < NOTHING; kind++) {
    const long left = atomic_load(&alive[kind]);
    if (report >= 0 && left) dprintf(report, "0 left %ld %s\n", left, objects[kind]);
  }
}

// The return value of this call: CL_SUCCESS unless it must fail.
static cl_int fault(const char *kind, const char *name) {
  if (!strstr(kinds, kind)) return CL_SUCCESS;
  const long n = atomic_fetch_add(&calls, 1) + 1;
  const int failed = first > 0 && n >= first && n <= last;
  char line[128];
  const int length =
      snprintf(line, sizeof line, "%ld %s %s\n", n, failed ? "failed" : "made", name);
  if (report >= 0 && write(report, line, (size_t)length) < 0) return code;
  while (failed && code > 0) pause();
  return failed ? code : CL_SUCCESS;
}

// A call that returns its error code; one that is tried first; one that may create an event; one that creates an
// object and returns its error code in `error`.
#define CALL(kind, name, parameters, arguments)    \
  cl_int name parameters {                         \
    const cl_int failed = fault(kind, #name);      \
    return failed ? failed : NEXT(name) arguments; \
  }
#define TRIED(kind, name, parameters, arguments) \
  cl_int name parameters {                       \
    const cl_int result = NEXT(name) arguments;  \
    const cl_int failed = fault(kind, #name);    \
    return failed ? failed : result;             \
  }
#define ENQUEUE(kind, name, parameters, arguments)                \
  cl_int name parameters {                                        \
    const cl_int failed = fault(kind, #name);                     \
    const cl_int result = failed ? failed : NEXT(name) arguments; \
    if (result == CL_SUCCESS && event) alive[EVENT]++;            \
    return result;                                                \
  }
#define MAKE(kind, object, type, name, parameters, arguments) \
  type name parameters {                                      \
    const cl_int failed = fault(kind, #name);                 \
    if (failed && error) *error = failed;                     \
    type made = failed ? NULL : NEXT(name) arguments;         \
    if (made) alive[object]++;                                \
    return made;                                              \
  }
#define COUNT(object, type, what)                    \
  cl_int clRetain##what(type it) {                   \
    const cl_int result = NEXT(clRetain##what)(it);  \
    if (result == CL_SUCCESS) alive[object]++;       \
    return result;                                   \
  }                                                  \
  cl_int clRelease##what(type it) {                  \
    const cl_int result = NEXT(clRelease##what)(it); \
    if (result == CL_SUCCESS) alive[object]--;       \
    return result;                                   \
  }

COUNT(CONTEXT, cl_context, Context)
COUNT(QUEUE, cl_command_queue, CommandQueue)
COUNT(PROGRAM, cl_program, Program)
COUNT(KERNEL, cl_kernel, Kernel)
COUNT(BUFFER, cl_mem, MemObject)
COUNT(EVENT, cl_event, Event)

MAKE("setup", CONTEXT, cl_context, clCreateContext,
     (const cl_context_properties *properties, cl_uint count, const cl_device_id *devices,
      void(CL_CALLBACK *notify)(const char *, const void *, size_t, void *), void *data,
      cl_int *error),
     (properties, count, devices, notify, data, error))
MAKE("setup", QUEUE, cl_command_queue, clCreateCommandQueue,
     (cl_context context, cl_device_id device, cl_command_queue_properties properties,
      cl_int *error),
     (context, device, properties, error))
MAKE("build", PROGRAM, cl_program, clCreateProgramWithSource,
     (cl_context context, cl_uint count, const char **texts, const size_t *lengths, cl_int *error),
     (context, count, texts, lengths, error))
MAKE("binary", PROGRAM, cl_program, clCreateProgramWithBinary,
     (cl_context context, cl_uint count, const cl_device_id *devices, const size_t *lengths,
      const unsigned char **binaries, cl_int *states, cl_int *error),
     (context, count, devices, lengths, binaries, states, error))
TRIED("build", clBuildProgram,
      (cl_program program, cl_uint count, const cl_device_id *devices, const char *options,
       void(CL_CALLBACK *notify)(cl_program, void *), void *data),
      (program, count, devices, options, notify, data))
CALL("binary", clGetProgramInfo,
     (cl_program program, cl_program_info what, size_t room, void *value, size_t *size),
     (program, what, room, value, size))
MAKE("kernel", KERNEL, cl_kernel, clCreateKernel,
     (cl_program program, const char *name, cl_int *error),
     (program, name, error))
CALL("argument", clSetKernelArg, (cl_kernel kernel, cl_uint i, size_t size, const void *value),
     (kernel, i, size, value))
MAKE("create", BUFFER, cl_mem, clCreateBuffer,
     (cl_context context, cl_mem_flags flags, size_t size, void *host, cl_int *error),
     (context, flags, size, host, error))
ENQUEUE("launch", clEnqueueNDRangeKernel,
     (cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t *offset,
      const size_t *global, const size_t *local, cl_uint events, const cl_event *before,
      cl_event *event),
     (queue, kernel, dimensions, offset, global, local, events, before, event))
ENQUEUE("copy", clEnqueueReadBuffer,
     (cl_command_queue queue, cl_mem buffer, cl_bool wait, size_t at, size_t size, void *to,
      cl_uint events, const cl_event *before, cl_event *event),
     (queue, buffer, wait, at, size, to, events, before, event))
ENQUEUE("copy", clEnqueueWriteBuffer,
     (cl_command_queue queue, cl_mem buffer, cl_bool wait, size_t at, size_t size, const void *from,
      cl_uint events, const cl_event *before, cl_event *event),
     (queue, buffer, wait, at, size, from, events, before, event))
ENQUEUE("copy", clEnqueueCopyBuffer,
     (cl_command_queue queue, cl_mem from, cl_mem to, size_t from_at, size_t to_at, size_t size,
      cl_uint events, const cl_event *before, cl_event *event),
     (queue, from, to, from_at, to_at, size, events, before, event))
ENQUEUE("copy", clEnqueueFillBuffer,
     (cl_command_queue queue, cl_mem buffer, const void *pattern, size_t pattern_size, size_t at,
      size_t size, cl_uint events, const cl_event *before, cl_event *event),
     (queue, buffer, pattern, pattern_size, at, size, events, before, event))
MAKE("copy", NOTHING, void *, clEnqueueMapBuffer,
     (cl_command_queue queue, cl_mem buffer, cl_bool wait, cl_map_flags flags, size_t at,
      size_t size, cl_uint events, const cl_event *before, cl_event *event, cl_int *error),
     (queue, buffer, wait, flags, at, size, events, before, event, error))
CALL("flush", clFlush, (cl_command_queue queue), (queue))
TRIED("wait", clFinish, (cl_command_queue queue), (queue))
TRIED("wait", clWaitForEvents, (cl_uint count, const cl_event *events), (count, events))

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t room, void *value,
                       size_t *size) {
  const cl_int result = NEXT(clGetDeviceInfo)(device, what, room, value, size);
  const char *name = what == CL_DEVICE_MAX_MEM_ALLOC_SIZE ? "CLFAULT_LARGEST"
                     : what == CL_DEVICE_GLOBAL_MEM_SIZE  ? "CLFAULT_MEMORY"
                                                          : NULL;
  if (result == CL_SUCCESS && name && getenv(name) && value && room >= sizeof(cl_ulong))
    *(cl_ulong *)value = (cl_ulong)number(name, 0);
  return result;
}
