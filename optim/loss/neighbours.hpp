// SPDX-License-Identifier: Apache-2.0
// Which Gaussians are neighbours: pairs that should move alike.
#pragma once
#include "optim/formats/npz.hpp"
#include "optim/motion/motion.hpp"

namespace gflow {

// Pairs {i, j}, each listed with both: those of Gaussian i are offsets[i] .. offsets[i + 1] - 1, by
// rising number of the other.
struct NeighbourPairs {
  std::vector<cl_uint> offsets;  // [N + 1]
  std::vector<cl_uint> others;   // [P] the other one
  std::vector<float> distances;  // [P] at the moment of reference [scene units]
};

struct NeighbourRule {
  size_t count = 8;    // i and j are a pair when one is among the other's nearest so many
  float duration = 1;  // length of the video [model time]
  size_t moments = 1;  // at which it is asked who is there, evenly spread over the video
};

// Neighbours among the Gaussians as they are now. Each looks for its own at the moment of reference
// nearest to the middle of its life, among those who are there then; one who is nowhere finds none.
// A pair's distance is that at the moment of the lower number's search, if that one found the
// other, else at that of the higher one's. Waits; a function of the parameters alone.
NeighbourPairs find_neighbours(Queue& queue, const Parameters& parameters, Motion& motion,
                               const NeighbourRule& rule);

// For a checkpoint, since they are those of an earlier step: neighbours/offsets, others, distances.
void save_state(const NeighbourPairs& pairs, Arrays& arrays);
// The reverse. Error when arrays are missing or are no pairs of `count` Gaussians; `path`: the
// file, for messages.
NeighbourPairs load_neighbours(const Arrays& arrays, size_t count, const std::string& path);

}  // namespace gflow
