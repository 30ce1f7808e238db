// SPDX-License-Identifier: Apache-2.0
// How many Gaussians the memory holds: so that density control stops growing before it is full.
#pragma once
#include "optim/motion/parameters.hpp"

namespace gflow {

// Of the model, what trains it and what draws it, while density control moves rows and old and new
// arrays are there at once [bytes a Gaussian]. `remembers`: Adam keeps a mean gradient of theirs;
// of keys always.
size_t bytes_per_gaussian(const Parameters& parameters, bool remembers);

// Most Gaussians within a budget [MiB], no array of theirs larger than the device gives in one
// piece. Budget 0: three quarters of the device's memory, the rest being for images, programs and
// whoever else uses it.
size_t most_gaussians(const DeviceInfo& device, const Parameters& parameters, size_t budget,
                      bool remembers);

}  // namespace gflow
