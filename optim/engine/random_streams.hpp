// SPDX-License-Identifier: Apache-2.0
// Streams of random numbers (shared/random.h). A number is a function of the run's seed, a stream
// and an index, so that training is repeatable however work is divided. Each use has its own
// stream; two uses of one stream would draw the same numbers. The order of views
// (train/curriculum.hpp) uses its rounds as streams, from 0 on.
#pragma once
#include "shared/dialect.h"

namespace gflow::streams {

enum : uint {
  // Per step.
  kSplit = 7,
  kPair = 8,
  kBackground = 9,
  kNoise = 10,
  kGuidance = 11,
  kAzimuth = 12,
  kElevation = 13,
  kGuidanceCamera = 14,
  kReach = 15,
  kTile = 16,
  kTileSeed = 17,
  kWeighed = 18,  // per training
  // Per guided view; the seed is a number of kGuidance.
  kTimestep = 31,
  kLatentNoise = 32,  // and 33: pairs of numbers
  // Initial Gaussians. kPosition and kColor are the first of three streams each.
  kPosition = 100,
  kColor = 110,
  kTime = 120,
  kStereoColumn = 130,
  kStereoRow = 131,
  kPlanes = 140,
  kNetwork = 141,
  kChangeRays = 142,
  kPathFrames = 143,
  kDynamicSeeds = 200,  // + 3 step + axis: all that follow
};

}  // namespace gflow::streams
