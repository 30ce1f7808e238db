// SPDX-License-Identifier: Apache-2.0
// Moves, drops and copies rows of tables: what density control does to every array. One work-item
// per element, which no other one writes: bitwise repeatable.

// New rows from old, in tables of `keys` rows per Gaussian, for n new and old_n old Gaussians:
//   fresh[k, j, c] = old[k, source[j], c]
// With `only_old`, rows of children (child[j] > 0) and of static sources become 0. A source from
// old_n on is static, without a row: it gives static_source[source[j], c] if has_static_source,
// or else `static_value`.
kernel void rows_gather(const uint keys, const uint n, const uint old_n, const uint width,
                        const int only_old, const float static_value, const int has_static_source,
                        global const uint* restrict source, global const uint* restrict child,
                        global const float* old, global const float* static_source,
                        global float* restrict fresh) {
  const size_t at = get_global_id(0), row = at / width;
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n, from = source[j], c = at % width;
  float value = static_value;
  if (only_old && (child[j] || from >= old_n))
    value = 0.f;
  else if (from < old_n)
    value = old[((size_t)k * old_n + from) * width + c];
  else if (has_static_source)
    value = static_source[(size_t)from * width + c];
  fresh[at] = value;
}

kernel void rows_gather_counts(const uint keys, const uint n, const uint old_n,
                               global const uint* restrict source,
                               global const uint* restrict child, global const uint* restrict old,
                               global uint* restrict fresh) {
  const size_t row = get_global_id(0);
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n, from = source[j];
  fresh[row] = child[j] || from >= old_n ? 0u : old[(size_t)k * old_n + from];
}

// moves: whether each row of density control's result is dynamic: its source was, or if `wakes`, it
// is a child.
kernel void rows_dynamic(const uint n, const uint moving, const int wakes,
                         global const uint* restrict source, global const uint* restrict child,
                         global uint* restrict moves) {
  const uint j = get_global_id(0);
  if (j < n) moves[j] = source[j] < moving || (wakes && child[j] > 0);
}

// Puts the dynamic rows first, otherwise in the order they had; before[n] is their number.
kernel void rows_partition(const uint n, global const uint* restrict moves,
                           global const uint* restrict before,  // [N + 1] dynamic rows before each
                           global const uint* restrict source, global const uint* restrict child,
                           global uint* restrict sorted_source,
                           global uint* restrict sorted_child) {
  const uint j = get_global_id(0);
  if (j >= n) return;
  const uint at = moves[j] ? before[j] : before[n] + j - before[j];
  sorted_source[at] = source[j];
  sorted_child[at] = child[j];
}
