// SPDX-License-Identifier: Apache-2.0
// The network of the hexplane motion model on a block of Gaussians: forward, and the gradients of its
// weights. Vectors hold LANES neurons.
#include "motion/hexplane_planes.cl"

#define OUTPUTS HEXPLANE_OUTPUTS
#if LANES == 1
#define BLOCK 1  // Gaussians at once
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

#define LAYER_START(layer) hexplane_weights(FEATURES, HIDDEN, layer)
#define LAYER_INPUTS(layer) ((layer) == 0 ? FEATURES : HIDDEN)
#define LAYER_OUTPUTS(layer) ((layer) == LAYERS ? OUTPUTS : HIDDEN)
#define WEIGHTS (LAYER_START(LAYERS) + (HIDDEN + 1) * OUTPUTS)

// Inputs of all layers, then the outputs.
typedef struct Activations {
  float features[BLOCK * FEATURES];
  float hidden[LAYERS][BLOCK * HIDDEN];
  float outputs[BLOCK * OUTPUTS];
} Activations;

// For the Gaussians rows[0 .. count - 1]; the remaining entries of the block repeat the last one.
static inline void network_fwd(const uint* rows, int count, HexplaneGrid grid,
                               global const float* means, global const float* planes,
                               global const float* lines, global const float* network,
                               Activations* a) {
  for (int b = 0; b < BLOCK; ++b) {
    const real3 mean = load3(means, rows[min(b, count - 1)]);
    for (int level = 0; level < LEVELS; ++level) {
      const Corner c = corner_of(mean, grid, level);
      for (int part = 0; part < PARTS; ++part)
        ROW_STORE(features_of(grid, level, c, part, planes, lines),
                  a->features + b * FEATURES + level * CHANNELS + part * LANES);
    }
  }
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
kernel void hexplane_transpose(global const float* restrict network,
                               global float* restrict transposed) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  int layer = 0;
  while (layer < LAYERS && w >= LAYER_START(layer + 1)) ++layer;
  const uint start = LAYER_START(layer), k = (w - start) / LAYER_OUTPUTS(layer);
  const uint j = (w - start) % LAYER_OUTPUTS(layer), inputs = LAYER_INPUTS(layer);
  if (k < inputs) transposed[start + j * inputs + k] = network[w];
}

// Floats that a GPU stores per Gaussian for hexplane_bwd_network: inputs of all layers, then the
// gradients of their outputs.
#define KEPT_INPUTS (FEATURES + LAYERS * HIDDEN)
#define KEPT (KEPT_INPUTS + LAYERS * HIDDEN + OUTPUTS)

// GPU: each weight's gradient from `length` Gaussians. One work-item per weight and chunk.
kernel void hexplane_bwd_network(const uint n, const uint length,
                                 global const uint* restrict tiles_touched,
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
    if (tiles_touched[i] == 0) continue;
    global const float* keep = kept + (size_t)i * KEPT;
    sum = fma(k == LAYER_INPUTS(layer) ? 1.f : keep[in], keep[out], sum);
  }
  v_networks[id] = sum;
}

// Sums the chunks' gradients of the weights. One work-item per weight.
kernel void hexplane_sum_network(const uint chunks, global const float* restrict v_networks,
                                 global uint* restrict seen, global float* restrict v_network) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  float sum = seen[w] ? v_network[w] : 0.f;
  for (uint c = 0; c < chunks; ++c) sum += v_networks[(size_t)c * WEIGHTS + w];
  v_network[w] = sum;
  seen[w] = 1;
}
