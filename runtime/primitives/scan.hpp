// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum of unsigned integers on the device.
#pragma once
#include <memory>

#include "runtime/cl/kernel.hpp"

namespace gflow {

// Any length; the result depends on nothing but the input.
class Scan {
 public:
  explicit Scan(Queue& queue);

  // out[i] = in[0] + ... + in[i - 1] for i = 0 .. n; out[n] is the total. `out` is made to hold
  // n + 1 elements. Sums are kept in 64 bits, of which `out` gets the low 32: a caller that may
  // exceed them asks total(). Does not wait.
  void exclusive(Queue& queue, const Buffer<cl_uint>& in, Buffer<cl_uint>& out, size_t n);

  // The total of the last exclusive(), in 64 bits; waits for it.
  uint64_t total(Queue& queue) const;
  // The same in two parts: asks for it, to be waited for when other work is queued behind.
  void fetch_total(Queue& queue);
  uint64_t fetched_total();

 private:
  // What the device may still write to is not let go of. The queue stays where it is meanwhile.
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
