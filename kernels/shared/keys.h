// SPDX-License-Identifier: Apache-2.0
// Where a time lies among the keys of a path: at most four neighbouring keys and their weights,
// the same for all Gaussians (optim/motion/keys.hpp makes it).
#ifndef GFLOW_KEYS_H
#define GFLOW_KEYS_H

#define KEYS_AT_ONCE 4
typedef struct KeyWeights {
  int first, count;            // keys first .. first + count - 1, 1 to 4 of them
  float weight[KEYS_AT_ONCE];  // 0 beyond count; their sum is 1
} KeyWeights;

#endif
