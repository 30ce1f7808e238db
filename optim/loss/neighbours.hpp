// SPDX-License-Identifier: Apache-2.0
// Neighbour search: pairs of Gaussians that should move alike.
#pragma once
#include "optim/formats/npz.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

// Pairs {i, j}, each listed for both. Those of Gaussian i are offsets[i] .. offsets[i + 1] - 1, in
// ascending order of the other.
struct NeighbourPairs {
  std::vector<cl_uint> offsets;  // [N + 1]
  std::vector<cl_uint> others;   // [P] the other Gaussian
  std::vector<float> distances;  // [P] at the time of the search [scene units]
};

struct NeighbourRule {
  size_t count = 8;    // i and j are a pair if one is among this many nearest of the other
  float duration = 1;  // length of the video [model time]
  size_t moments = 1;  // number of search times, evenly spread over the video
};

// Finds neighbours among the Gaussians as they are now. Each Gaussian searches at the search time
// nearest to its temporal mean, among those visible then; an invisible one finds none. The distance
// of a pair is that at the search of its lower number if this found the other, else that at the
// search of the higher number. Waits. A function of the parameters alone.
NeighbourPairs find_neighbours(Queue& queue, const Parameters& parameters, Motion& motion,
                               const NeighbourRule& rule);

// For a checkpoint, because the neighbours depend on an earlier step: neighbours/offsets, others,
// distances.
void save_state(const NeighbourPairs& pairs, Arrays& arrays);
// The reverse. Error if arrays are missing or are not pairs of `count` Gaussians; `path`: the file,
// for messages.
NeighbourPairs load_neighbours(const Arrays& arrays, size_t count, const std::string& path);

}  // namespace gflow
