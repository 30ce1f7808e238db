// SPDX-License-Identifier: Apache-2.0
// Key weights of a path at one time: at most four neighbouring keys, the same for all Gaussians.
// Computed by key_weights() (optim/motion/keys.hpp).
#ifndef GFLOW_KEYS_H
#define GFLOW_KEYS_H

#define KEYS_AT_ONCE 4
typedef struct KeyWeights {
  int first, count;            // keys first .. first + count - 1; count is 1 to 4
  float weight[KEYS_AT_ONCE];  // 0 beyond count; their sum is 1
} KeyWeights;

#endif
