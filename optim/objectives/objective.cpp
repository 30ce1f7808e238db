// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/objective.hpp"

#include <cmath>

namespace gflow {

double LossReport::value(const std::string& name) const {
  for (const Term& term : terms)
    if (term.name == name) return term.value;
  return std::nan("");
}

}  // namespace gflow
