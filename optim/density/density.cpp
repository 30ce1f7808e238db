// SPDX-License-Identifier: Apache-2.0
#include "optim/density/density.hpp"

#include "optim/density/adc.hpp"
#include "optim/density/mcmc.hpp"

namespace gflow {

std::unique_ptr<Density> make_density(Queue& queue, DensityKind kind) {
  switch (kind) {
    case DensityKind::adc:
      return std::make_unique<AdcDensity>(queue);
    case DensityKind::mcmc:
      return std::make_unique<McmcDensity>(queue);
  }
  throw Error("unknown density strategy");
}

}  // namespace gflow
