// SPDX-License-Identifier: Apache-2.0
// First stage of sums over long arrays: one partial result per block of 256 elements; the host adds
// those in double. The order of additions depends on the elements' indices alone, so every run and
// device gives the same bits.
#define BLOCK 256

// One work-item per block: element i is added to lane i % 16, then the lanes pairwise.
kernel void reduce_sum(const uint first, const uint n, global const float* restrict values,
                       global float* restrict partial) {  // [ceil(n / BLOCK)]
  const uint block = get_global_id(0);
  if ((size_t)block * BLOCK >= n) return;
  const uint begin = block * BLOCK, count = min((uint)BLOCK, n - begin);
  global const float* in = values + first + begin;
  float4 a = 0, b = 0, c = 0, d = 0;  // lanes 0-3, 4-7, 8-11, 12-15
  const uint whole = count / 16;
  for (uint i = 0; i < whole; ++i) {
    a += vload4(4 * i, in);
    b += vload4(4 * i + 1, in);
    c += vload4(4 * i + 2, in);
    d += vload4(4 * i + 3, in);
  }
  if (count % 16 != 0) {
    float tail[16];
    for (uint i = 0; i < 16; ++i) tail[i] = whole * 16 + i < count ? in[whole * 16 + i] : 0;
    a += vload4(0, tail);
    b += vload4(1, tail);
    c += vload4(2, tail);
    d += vload4(3, tail);
  }
  const float4 four = (a + c) + (b + d);
  const float2 two = four.lo + four.hi;
  partial[block] = two.x + two.y;
}

// One work-item per block: how many elements are larger than `than`.
kernel void reduce_count(const uint first, const uint n, const uint than,
                         global const uint* restrict values,
                         global uint* restrict partial) {  // [ceil(n / BLOCK)]
  const uint block = get_global_id(0);
  if ((size_t)block * BLOCK >= n) return;
  const uint begin = block * BLOCK, end = min(n, begin + BLOCK);
  uint count = 0;
  for (uint i = begin; i < end; ++i) count += values[first + i] > than;
  partial[block] = count;
}
