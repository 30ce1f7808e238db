// SPDX-License-Identifier: Apache-2.0
// Compares a scene on the device with the dense sum over all splats at every pixel, in double.
#pragma once
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {

// Adds rows for colour and alpha, depth and flow (relative to the largest), the share of pixels
// left out as doubtful, and the worst gradient. NaN counts as infinitely wrong.
inline void compare_with_dense(Queue& queue, const PosedScene& s, const std::string& name,
                               Rows& rows) {
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  const std::vector<uint8_t>& doubtful = r.contributors.doubtful;
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  rows.push_back({name + ", colour and alpha",
                  worst({largest_error(images.at("rgb"), r.images.rgb, doubtful),
                         largest_error(images.at("alpha"), r.images.alpha, doubtful)}),
                  1e-5});
  double deepest = 0;
  for (const double z : r.images.depth) deepest = std::max(deepest, std::fabs(z));
  rows.push_back({name + ", depth, relative to the largest",
                  largest_error(images.at("depth"), r.images.depth, doubtful) / deepest, 1e-5});
  double fastest = 0;
  for (const double f : r.images.flow) fastest = std::max(fastest, std::fabs(f));
  rows.push_back({name + ", flow, relative to the largest",
                  largest_error(images.at("flow"), r.images.flow, doubtful) / fastest, 1e-5});
  rows.push_back(
      {name + ", share of pixels skipped as ambiguous", share_of(doubtful), kMostDoubtful});
  const reference::Planes v = random_cotangents(s, 22, doubtful);
  const FloatArrays found = device.backward(v);
  std::vector<double> errors;
  for (const auto& [key, values] :
       reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v)))
    errors.push_back(norm(values) > 1e-6 ? relative_l2(found.at(key), values)
                                         : distance(found.at(key), values));
  rows.push_back({name + ", worst gradient, relative L2", worst(errors), 1e-4});
}

}  // namespace gflow::stress
