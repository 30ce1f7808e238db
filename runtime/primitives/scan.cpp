// SPDX-License-Identifier: Apache-2.0
// Three launches; see kernels/primitives/scan.cl.
#include "runtime/primitives/scan.hpp"

#include "runtime/cl/chunks.hpp"

namespace gflow {

Scan::Scan(Queue& queue)
    : group_(chunk_group(queue)),
      program_(queue, "common.cl"),
      scan_sums_(program_, "scan_sums"),
      scan_offsets_(program_, "scan_offsets"),
      scan_write_(program_, "scan_write"),
      sums_("scan sums"),
      total_(queue, {0}, "scan total") {}

void Scan::exclusive(Queue& queue, const Buffer<cl_uint>& in, Buffer<cl_uint>& out, size_t n) {
  if (n > in.size())
    throw Error(
        fmt::format("prefix sum of {} elements of {}, which has {}", n, in.name(), in.size()));
  const Chunks chunks = chunks_for(queue, n, 1024);
  sums_.ensure(queue, chunks.count);
  out.ensure(queue, n + 1);
  const Range range = Range::groups(chunks.count, size_t(group_));
  scan_sums_(queue, range, cl_uint(n), chunks.length, in, sums_);
  scan_offsets_(queue, Range::groups(1, size_t(group_)), chunks.count, sums_, total_);
  scan_write_(queue, range, cl_uint(n), chunks.length, in, sums_, out);
}

uint64_t Scan::total(Queue& queue) const { return total_.read(queue)[0]; }

void Scan::fetch_total(Queue& queue) {
  fetched_ = std::make_unique<Fetched>(queue);
  fetched_->event = total_.read_async(queue, fetched_->value);
  cl_call("flushing the queue", [&] { queue.handle.flush(); });
}

uint64_t Scan::fetched_total() {
  fetched_->queue.wait("waiting for a total", [&] { fetched_->event.wait(); });
  fetched_->event = cl::Event();  // so that the destructor does not wait
  return fetched_->value[0];
}

}  // namespace gflow
