// SPDX-License-Identifier: Apache-2.0
#include "optim/options/quality.hpp"

namespace gflow {

std::vector<std::string> settings_of(Quality quality) {
  switch (quality) {
    case Quality::draft:
      return {"train.iterations=2000"};
    case Quality::standard:
      return {};
    case Quality::best:
      return {"train.iterations=60000"};
  }
  return {};
}

}  // namespace gflow
