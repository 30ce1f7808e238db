// SPDX-License-Identifier: Apache-2.0
// The field of the models hexplane and nodes (shared/motion/hexplane.h): planes of features and a
// network that reads them. Part of hexplane.cl and nodes.cl.
#include "motion/hexplane_planes.cl"
#include "motion/network.cl"

// For the places rows[0 .. count - 1]; the remaining entries of the block repeat the last one.
static inline void field_fwd(const uint* rows, int count, HexplaneGrid grid,
                             global const float* places, global const float* planes,
                             global const float* lines, global const float* network,
                             Activations* a) {
  for (int b = 0; b < BLOCK; ++b) {
    const real3 place = load3(places, rows[min(b, count - 1)]);
    for (int level = 0; level < LEVELS; ++level) {
      const Corner c = corner_of(place, grid, level);
      for (int part = 0; part < PARTS; ++part)
        ROW_STORE(features_of(grid, level, c, part, planes, lines),
                  a->features + b * FEATURES + level * CHANNELS + part * LANES);
    }
  }
  network_fwd(network, a);
}
