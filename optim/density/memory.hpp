// SPDX-License-Identifier: Apache-2.0
// Memory budget: how many Gaussians fit, so that density control stops growing in time.
#pragma once
#include "optim/motion/parameters.hpp"

namespace gflow {

// Device memory per Gaussian [bytes]: model, optimiser and renderer, while density control moves
// rows and old and new arrays coexist. `remembers`: Adam keeps a mean gradient for the Gaussians'
// table; for keys it always does.
size_t bytes_per_gaussian(const Parameters& parameters, bool remembers);

// Largest number of Gaussians within a budget [MiB], with no array larger than the device allocates
// in one piece. Budget 0: three quarters of the device's memory; the rest is for images, programs
// and other processes.
size_t most_gaussians(const DeviceInfo& device, const Parameters& parameters, size_t budget,
                      bool remembers);

}  // namespace gflow
