// SPDX-License-Identifier: Apache-2.0
// Initial model. Static Gaussians that last for the whole video, at the scene's points, at random
// points if it has none, or from a splat file; and short-lived ones where static cameras see
// motion.
#pragma once
#include "optim/flow/flow_store.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// The initial model. Random points are uniform in a box around the point that the cameras look at.
// Those of a visual hull are kept if most cameras, by the alpha of their images, see them on the
// object around a time, which becomes their temporal mean. Gaussians of a file are taken unchanged,
// permanent and static. parts[i] is the focus region of training frame i; flows[i] belongs to
// pairs[i], and both may be empty. Deterministic for config.train.seed. Error if the scene lacks
// what init.from asks for, or the file is not a static splat file or has more than density.cap
// Gaussians.
HostModel initial_model(const Scene& scene, FrameStore& frames, const std::vector<Rect>& parts,
                        const std::vector<StaticCamera>& static_cameras,
                        const std::vector<FlowPair>& pairs, FlowStore& flows,
                        const TrainOptions& config);

// Throws the Error that initial_model would throw for init.file, before other work is done.
void require_init_file(const TrainOptions& config);
// Throws the Error that initial_model would throw because the scene lacks what init.from asks for.
void require_first_points(const Scene& scene, const InitOptions& init);
// The motion model: the one of the settings, or the one that suits the scene. If one camera at a
// time sees the scene, only a canonical pose constrains Gaussians that are not seen, unless they
// begin on known paths (optim/motion/README.md).
MotionModelKind motion_model(const Scene& scene, const TrainOptions& config);
// Shape of the model, from settings and scene.
ModelShape model_shape(const Scene& scene, const TrainOptions& config);

// Mean distance to the three nearest other points, for each of xyz [n, 3]; never 0.
std::vector<float> neighbour_distance(const std::vector<float>& xyz);

}  // namespace gflow
