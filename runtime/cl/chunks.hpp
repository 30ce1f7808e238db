// SPDX-License-Identifier: Apache-2.0
// How arrays are split for kernels with one work-group per chunk (scan, sort). Decided only here: a
// CPU wants a few long chunks, each run by one work-item; a GPU wants many groups.
#pragma once
#include "runtime/cl/queue.hpp"

namespace gflow {

// `count` chunks of `length` elements cover the array; the last ones may be short or empty.
struct Chunks {
  cl_uint count, length;
};

// At least one chunk, and none shorter than `least` elements unless it is the only one. Error for
// arrays of 2^31 elements or more: kernels index with 32 bits.
Chunks chunks_for(const Queue& queue, size_t size, size_t least);

// The same for sums of floats, whose rounding depends on the split: up to `most` chunks, whatever
// the number of cores.
Chunks chunks_of_sums(size_t size, size_t least, size_t most);

// Work-items per chunk: 1 or 256.
int chunk_group(const Queue& queue);

}  // namespace gflow
