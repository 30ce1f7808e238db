// SPDX-License-Identifier: Apache-2.0
// Which stream of random numbers is whose (shared/random.h: a number is a function of the run's
// seed, a stream and an index, so that training gives the same bits however it is divided): two
// uses of one stream would draw the same numbers. Only the order of views (curriculum.hpp) has its
// rounds as streams, from 0 on.
#pragma once
#include "shared/dialect.h"

namespace gflow::streams {

enum : uint {
  // Of each step.
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
  // Of each view that is guided; its seed is one of kGuidance's.
  kTimestep = 31,
  kLatentNoise = 32,  // and 33: a pair
  // Of the first Gaussians: each of an axis and those after it.
  kPosition = 100,
  kColor = 110,
  kTime = 120,
  kStereoColumn = 130,
  kStereoRow = 131,
  kPlanes = 140,
  kNetwork = 141,
  kDynamicSeeds = 200,  // + 3 step + axis: all that follow
};

}  // namespace gflow::streams
