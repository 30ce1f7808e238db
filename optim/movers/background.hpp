// SPDX-License-Identifier: Apache-2.0
// What rests in the video of a moving camera: a static model of it, and where images differ from
// it, which is what moves.
#pragma once
#include "optim/cameras/suspects.hpp"
#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

struct StillBackground {
  HostModel model;                         // all static; of the spacetime model
  std::vector<Mask> moving;                // one per frame of the small video
  std::vector<std::vector<float>> depths;  // [height, width] along the axis; infinite where empty
};

// Trains a model on a scene in memory; reports the steps made.
using TrainModel =
    std::function<HostModel(Scene scene, const TrainOptions& options, const ProgressCallback&)>;

// Trains a static model for options.init.background steps on all pixels that are not suspects, then
// compares it with the images: in what moves, pixels differ from it and their neighbourhood holds
// suspects.
StillBackground background_of(Queue& queue, const Scene& scene, FrameStore& store,
                              const SmallVideo& video, const Suspects& suspects,
                              const TrainOptions& options, const TrainModel& train,
                              const ProgressCallback& progress);

}  // namespace gflow
