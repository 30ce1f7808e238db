// SPDX-License-Identifier: Apache-2.0
// Fits the pose of a view to its image while the model stays as it is. Where training corrects the
// cameras, those of other views do not follow exactly: without this, evaluation would measure them
// rather than the model.
#pragma once
#include "optim/model/renderer.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Gauss-Newton on robust differences of colour, first of images reduced to an eighth, then of
// larger ones; derivatives by differences of rendered images. Errors of a fiftieth of the image are
// corrected. shot: the view as it is drawn; depth: of what the camera sees [scene units]. Returns
// the world-to-camera pose; the start where nothing fits better.
Eigen::Matrix4d fitted_pose(Queue& queue, Model& model, Renderer& renderer, const Shot& shot,
                            const Camera& start, double depth, const Image& truth,
                            const Image* counted);

}  // namespace gflow
