// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum of unsigned integers on the device.
#pragma once
#include <memory>

#include "runtime/cl/kernel.hpp"

namespace gflow {

// For any length. The result depends on the input only.
class Scan {
 public:
  explicit Scan(Queue& queue);

  // out[i] = in[0] + ... + in[i - 1] for i = 0 .. n; out[n] is the total. `out` is resized to n + 1
  // elements. Sums have 64 bits, of which `out` gets the low 32: callers that may exceed them check
  // total(). Does not wait.
  void exclusive(Queue& queue, const Buffer<cl_uint>& in, Buffer<cl_uint>& out, size_t n);

  // The total of the last exclusive(), in 64 bits; waits for it.
  uint64_t total(Queue& queue) const;
  // The same in two parts, start and wait, so that other work can be queued in between.
  void fetch_total(Queue& queue);
  uint64_t fetched_total();

 private:
  // Keeps `value` alive until the device has written it. The queue must not move meanwhile.
  struct Fetched {
    Queue& queue;
    std::vector<cl_ulong> value;
    cl::Event event;
    explicit Fetched(Queue& queue) : queue(queue) {}
    ~Fetched() {
      if (event()) queue.wait_quietly(event);
    }
  };
  int group_;
  Program program_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, Out<cl_ulong>> scan_sums_;
  Kernel<cl_uint, Out<cl_ulong>, Out<cl_ulong>> scan_offsets_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_ulong>, Out<cl_uint>> scan_write_;
  Buffer<cl_ulong> sums_;   // [chunks]
  Buffer<cl_ulong> total_;  // [1]
  std::unique_ptr<Fetched> fetched_;
};

}  // namespace gflow
