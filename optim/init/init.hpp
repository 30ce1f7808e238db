// SPDX-License-Identifier: Apache-2.0
// The first Gaussians: at the scene's points, random ones where it has none, or those of a splat
// file, standing still and lasting for the whole video; and short-lived ones where fixed cameras
// see something move.
#pragma once
#include "optim/flow/flow_store.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Random points fill a box around the place the cameras look at; those of a visual hull are the
// ones that most cameras, by the alpha of their pictures, see as part of the object around a time,
// which becomes theirs. A file's Gaussians are taken as they are, lasting and at rest.
// Deterministic for config.train.seed. Error when the scene has not what init.from asks for, or the
// file is no splat that stands still, or has more than density.cap Gaussians. parts[i] is the part
// of interest of training frame i; flows[i] belongs to pairs[i], and both of these may be empty.
HostModel initial_model(const Scene& scene, FrameStore& frames, const std::vector<Rect>& parts,
                        const std::vector<StaticCamera>& static_cameras,
                        const std::vector<FlowPair>& pairs, FlowStore& flows,
                        const TrainOptions& config);

// The Error that initial_model would throw for init.file, before time is spent on anything else.
void require_init_file(const TrainOptions& config);
// The Error that it would throw because the scene has not what init.from asks for.
void require_first_points(const Scene& scene, const InitOptions& init);
// The motion model that is asked for, or that suits the scene: from one camera at a time, only a
// common pose shows what a Gaussian does while it is not seen (optim/motion/README.md).
MotionModelKind motion_model(const Scene& scene, const MotionOptions& config);
// What the configuration and the scene say of the model.
ModelShape model_shape(const Scene& scene, const TrainOptions& config);

// Mean distance to the three nearest other points, for each of xyz [n, 3]; never 0.
std::vector<float> neighbour_distance(const std::vector<float>& xyz);

}  // namespace gflow
