// SPDX-License-Identifier: Apache-2.0
// What a device says of a view that it has rendered, so that every device adds the same gradients:
// those of the poses of the Gaussians drawn. The way from poses to parameters is repeated by each
// device, view after view in order, as one device alone would: so the sums have the same bits for
// any number of devices. Per Gaussian drawn 72 bytes, with flow 120; gradients of parameters would
// be 276 with all bands of spherical harmonics, and as much as the tables that Gaussians share.
#pragma once
#include "optim/model/renderer.hpp"

namespace gflow {

struct ViewRecord {
  Shot shot;                              // flow_tiles: nullptr
  std::vector<float> flow_tiles;          // View::flow_tiles; empty: none
  uint64_t gaussians = 0, moving = 0;     // of the model
  uint64_t drawn = 0, intersections = 0;  // Gaussians; with tiles
  std::vector<float> gradients;           // of the Gaussians drawn, array after array
  std::vector<std::vector<float>> taken;  // Objective::take_view() of each objective
};

// The record after Renderer::backward_to_poses(), without `taken`. shot: as given to forward().
// Waits.
ViewRecord record_of(Queue& queue, Renderer& renderer, const Model& model, const Shot& shot);
// Brings a renderer to the state that record_of() saw, except for images. tiles: memory for the
// flow tiles, which must live until the view is done. Error if this device has another model or
// draws other Gaussians. Waits.
GaussianGradients& restore(Queue& queue, Renderer& renderer, Model& model, const ViewRecord& record,
                           Buffer<float>& tiles);

// As bytes, one record after the other; take() moves `bytes` behind it.
void append(std::string& bytes, const ViewRecord& record);
ViewRecord take(const char*& bytes);

}  // namespace gflow
