// SPDX-License-Identifier: Apache-2.0
// See chunks.hpp. A queue with one lane uses work-items as on a GPU, whatever its device.
#include "runtime/cl/chunks.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace gflow {

Chunks chunks_for(const Queue& queue, size_t size, size_t least) {
  if (size >= size_t(1) << 31)
    throw Error(fmt::format(
        "an array of {} elements is too long for a sort or prefix sum; the maximum is 2^31 - 1",
        size));
  // CPU: 4 per core, so that a core taken by another process does not hold up the others.
  const size_t most = queue.lanes == 1 ? 1024 : std::min<size_t>(4 * queue.info.compute_units, 256);
  const size_t count = std::clamp<size_t>(size / least, 1, most);
  return {cl_uint(count), cl_uint((size + count - 1) / count)};
}

Chunks chunks_of_sums(size_t size, size_t least, size_t most) {
  const size_t count = std::clamp<size_t>(size / least, 1, most);
  return {cl_uint(count), cl_uint((size + count - 1) / count)};
}

int chunk_group(const Queue& queue) { return queue.lanes == 1 ? 256 : 1; }

}  // namespace gflow
