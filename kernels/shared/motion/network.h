// SPDX-License-Identifier: Apache-2.0
// The small networks that motion models share (hexplane, nodes): one or more hidden layers of equal
// width, then a linear one.
//   h = relu(W_0 f + b_0),  h = relu(W_k h + b_k) ...,  o = W h + b
// Weights of a layer: [inputs + 1][outputs], the last row the bias; layers one after the other. The
// last layer has NETWORK_OUTPUTS columns, of which a model may use the first few.
#ifndef GFLOW_NETWORK_H
#define GFLOW_NETWORK_H
#include "shared/dialect.h"

#define NETWORK_OUTPUTS 16

// Number of weights of the first `layers` layers, all hidden; the next one's start there.
static inline uint network_weights(uint features, uint hidden, int layers) {
  return layers == 0 ? 0 : (features + 1) * hidden + ((uint)layers - 1) * (hidden + 1) * hidden;
}

#endif
