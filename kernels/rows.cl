// SPDX-License-Identifier: Apache-2.0
// Tables with their rows moved, dropped or copied: what density control does to every array.
// One work-item an element; no two share one, so bitwise repeatable.

// New rows from old, in tables of `keys` rows a Gaussian: fresh[k, j, c] = old[k, source[j], c],
// n and old_n Gaussians; 0 for children (child[j] > 0) where `only_old`.
kernel void rows_gather(const uint keys, const uint n, const uint old_n, const uint width,
                        const int only_old, global const uint* restrict source,
                        global const uint* restrict child, global const float* restrict old,
                        global float* restrict fresh) {
  const size_t at = get_global_id(0), row = at / width;
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n;
  fresh[at] =
      only_old && child[j] ? 0.f : old[((size_t)k * old_n + source[j]) * width + at % width];
}

kernel void rows_gather_counts(const uint keys, const uint n, const uint old_n,
                               global const uint* restrict source,
                               global const uint* restrict child, global const uint* restrict old,
                               global uint* restrict fresh) {
  const size_t row = get_global_id(0);
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n;
  fresh[row] = child[j] ? 0u : old[(size_t)k * old_n + source[j]];
}
