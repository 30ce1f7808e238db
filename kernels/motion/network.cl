// SPDX-License-Identifier: Apache-2.0
// A network of a motion model (shared/motion/network.h) on a block of inputs: forward, backward, and
// the gradients of its weights. Part of hexplane.cl and nodes.cl, which define FEATURES, HIDDEN and
// LAYERS. Vectors hold LANES neurons. CPUs process a block at once, so that each weight read serves
// all of it; GPUs one input per work-item. Forward keeps no activations: backward recomputes them.
// Sums of gradients are made per chunk, each into memory of its own, then over the chunks in order:
// bitwise repeatable, without atomics.
#include "shared/lane_row.h"
#include "shared/motion/network.h"

#ifndef FEATURES  // only for the syntax check; the host always defines them
#define FEATURES 32
#define HIDDEN 64
#define LAYERS 2
#endif
#define OUTPUTS NETWORK_OUTPUTS
#if LANES == 1
#define BLOCK 1  // inputs at once
#define ROWS 1   // of these, rows held in registers by a layer, two vectors each
#else
#define BLOCK 32
#define ROWS (LANES == 16 ? 8 : 4)
#endif

// out [BLOCK, outputs] = in [BLOCK, inputs] w [inputs, outputs], plus w's next row, the bias, if
// `biased`. Two vectors of outputs at a time; a last one without a partner is computed twice.
static inline void layer_fwd(const float* in, const int inputs, global const float* w,
                             const int outputs, const int biased, float* out) {
  for (int j = 0; j < outputs; j += 2 * LANES) {
    const int j2 = j + LANES < outputs ? j + LANES : j;
    global const float* bias = w + (size_t)inputs * outputs;
    for (int b = 0; b < BLOCK; b += ROWS) {
      lane one[ROWS], two[ROWS];
#pragma unroll
      for (int u = 0; u < ROWS; ++u) {
        one[u] = biased ? ROW_LOAD(bias + j) : TO_LANE(0.f);
        two[u] = biased ? ROW_LOAD(bias + j2) : TO_LANE(0.f);
      }
      for (int k = 0; k < inputs; ++k) {
        const lane w1 = ROW_LOAD(w + (size_t)k * outputs + j);
        const lane w2 = ROW_LOAD(w + (size_t)k * outputs + j2);
#pragma unroll
        for (int u = 0; u < ROWS; ++u) {
          const lane x = TO_LANE(in[(b + u) * inputs + k]);
          one[u] = fma(x, w1, one[u]);
          two[u] = fma(x, w2, two[u]);
        }
      }
#pragma unroll
      for (int u = 0; u < ROWS; ++u) {
        ROW_STORE(one[u], out + (b + u) * outputs + j);
        ROW_STORE(two[u], out + (b + u) * outputs + j2);
      }
    }
  }
}

#if LANES > 1
// v_w [inputs + 1, outputs] += in^T v_out, and its last row the sum of v_out.
static inline void layer_bwd_weights(const float* in, const int inputs, const float* v_out,
                                     const int outputs, global float* v_w) {
  for (int j = 0; j < outputs; j += LANES) {
    for (int k = 0; k < inputs; k += ROWS) {
      lane sum[ROWS];
#pragma unroll
      for (int u = 0; u < ROWS; ++u) sum[u] = ROW_LOAD(v_w + (size_t)(k + u) * outputs + j);
      for (int b = 0; b < BLOCK; ++b) {
        const lane v = ROW_LOAD(v_out + b * outputs + j);
#pragma unroll
        for (int u = 0; u < ROWS; ++u) sum[u] = fma(TO_LANE(in[b * inputs + k + u]), v, sum[u]);
      }
#pragma unroll
      for (int u = 0; u < ROWS; ++u) ROW_STORE(sum[u], v_w + (size_t)(k + u) * outputs + j);
    }
    lane sum = ROW_LOAD(v_w + (size_t)inputs * outputs + j);
    for (int b = 0; b < BLOCK; ++b) sum += ROW_LOAD(v_out + b * outputs + j);
    ROW_STORE(sum, v_w + (size_t)inputs * outputs + j);
  }
}
#endif

#define LAYER_START(layer) network_weights(FEATURES, HIDDEN, layer)
#define LAYER_INPUTS(layer) ((layer) == 0 ? FEATURES : HIDDEN)
#define LAYER_OUTPUTS(layer) ((layer) == LAYERS ? OUTPUTS : HIDDEN)
#define WEIGHTS (LAYER_START(LAYERS) + (HIDDEN + 1) * OUTPUTS)

// Inputs of all layers, then the outputs.
typedef struct Activations {
  float features[BLOCK * FEATURES];
  float hidden[LAYERS][BLOCK * HIDDEN];
  float outputs[BLOCK * OUTPUTS];
} Activations;

// The outputs of a->features.
static inline void network_fwd(global const float* network, Activations* a) {
  layer_fwd(a->features, FEATURES, network, HIDDEN, 1, a->hidden[0]);
  for (int layer = 1; layer <= LAYERS; ++layer) {
    float* in = a->hidden[layer - 1];
    for (int k = 0; k < BLOCK * HIDDEN; k += LANES)
      ROW_STORE(fmax(ROW_LOAD(in + k), TO_LANE(0.f)), in + k);
    if (layer < LAYERS)
      layer_fwd(in, HIDDEN, network + LAYER_START(layer), HIDDEN, 1, a->hidden[layer]);
  }
  layer_fwd(a->hidden[LAYERS - 1], HIDDEN, network + LAYER_START(LAYERS), OUTPUTS, 1, a->outputs);
}

// The weights of each layer as [outputs][inputs], without bias. One work-item per weight.
kernel void network_transpose(global const float* restrict network,
                               global float* restrict transposed) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  int layer = 0;
  while (layer < LAYERS && w >= LAYER_START(layer + 1)) ++layer;
  const uint start = LAYER_START(layer), k = (w - start) / LAYER_OUTPUTS(layer);
  const uint j = (w - start) % LAYER_OUTPUTS(layer), inputs = LAYER_INPUTS(layer);
  if (k < inputs) transposed[start + j * inputs + k] = network[w];
}

// Floats that a GPU stores per input for network_bwd_weights: inputs of all layers, then the
// gradients of their outputs.
#define KEPT_INPUTS (FEATURES + LAYERS * HIDDEN)
#define KEPT (KEPT_INPUTS + LAYERS * HIDDEN + OUTPUTS)

// From the gradients of the outputs to those of the features, v_x, and of the weights: a CPU adds
// the latter to v_network, a GPU stores their factors in `keep`.
static inline void network_bwd(Activations* a, float* v_out, global const float* transposed,
                               global float* v_network, global float* keep, float* v_x) {
  float v_in[BLOCK * HIDDEN], v_next[BLOCK * HIDDEN];
#if LANES == 1
  for (int k = 0; k < FEATURES; ++k) keep[k] = a->features[k];
  for (int k = 0; k < LAYERS * HIDDEN; ++k) keep[FEATURES + k] = a->hidden[k / HIDDEN][k % HIDDEN];
  keep += KEPT_INPUTS;
  for (int k = 0; k < OUTPUTS; ++k) keep[LAYERS * HIDDEN + k] = v_out[k];
#else
  layer_bwd_weights(a->hidden[LAYERS - 1], HIDDEN, v_out, OUTPUTS, v_network + LAYER_START(LAYERS));
#endif
  layer_fwd(v_out, OUTPUTS, transposed + LAYER_START(LAYERS), HIDDEN, 0, v_in);
  for (int layer = LAYERS - 1; layer >= 0; --layer) {
    const float* out = a->hidden[layer];
    for (int k = 0; k < BLOCK * HIDDEN; k += LANES)
      ROW_STORE(LANE_SELECT(TO_LANE(0.f), ROW_LOAD(v_in + k), ROW_LOAD(out + k) > TO_LANE(0.f)),
                v_in + k);
#if LANES == 1
    for (int k = 0; k < HIDDEN; ++k) keep[layer * HIDDEN + k] = v_in[k];
#endif
    if (layer == 0) break;
#if LANES > 1
    layer_bwd_weights(a->hidden[layer - 1], HIDDEN, v_in, HIDDEN, v_network + LAYER_START(layer));
#endif
    layer_fwd(v_in, HIDDEN, transposed + LAYER_START(layer), HIDDEN, 0, v_next);
    for (int k = 0; k < BLOCK * HIDDEN; k += LANES) ROW_STORE(ROW_LOAD(v_next + k), v_in + k);
  }
#if LANES > 1
  layer_bwd_weights(a->features, FEATURES, v_in, HIDDEN, v_network);
#endif
  layer_fwd(v_in, HIDDEN, transposed, FEATURES, 0, v_x);
}

// GPU: each weight's gradient from `length` inputs. One work-item per weight and chunk.
kernel void network_bwd_weights(const uint n, const uint length,
                                global const uint* restrict used,     // [N]
                                global const float* restrict kept,    // [N, KEPT]
                                global float* restrict v_networks) {  // [chunks, WEIGHTS]
  const uint id = get_global_id(0), w = id % WEIGHTS, begin = id / WEIGHTS * length;
  const uint end = min(n, begin + length);
  int layer = 0;
  while (layer < LAYERS && w >= LAYER_START(layer + 1)) ++layer;
  const uint start = LAYER_START(layer), k = (w - start) / LAYER_OUTPUTS(layer);
  const uint j = (w - start) % LAYER_OUTPUTS(layer);
  const uint in = layer == 0 ? k : FEATURES + (layer - 1) * HIDDEN + k;
  const uint out = KEPT_INPUTS + layer * HIDDEN + j;
  float sum = 0.f;
  for (uint i = begin; i < end; ++i) {
    if (used[i] == 0) continue;
    global const float* keep = kept + (size_t)i * KEPT;
    sum = fma(k == LAYER_INPUTS(layer) ? 1.f : keep[in], keep[out], sum);
  }
  v_networks[id] = sum;
}

// Sums the chunks' gradients of the weights. One work-item per weight.
kernel void network_sum(const uint chunks, global const float* restrict v_networks,
                                 global uint* restrict seen, global float* restrict v_network) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  float sum = seen[w] ? v_network[w] : 0.f;
  for (uint c = 0; c < chunks; ++c) sum += v_networks[(size_t)c * WEIGHTS + w];
  v_network[w] = sum;
  seen[w] = 1;
}
