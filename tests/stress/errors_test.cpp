// SPDX-License-Identifier: Apache-2.0
#include "apps/stress/errors.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

// A result aggregates many errors: a non-finite one must fail it at any position.
TEST(Errors, AValueThatIsNoNumberFailsWhereverItStands) {
  const double nan = std::nan("");
  for (size_t at = 0; at < 3; ++at) {
    std::vector<double> errors{.1, .2, .3};
    errors[at] = nan;
    double most = 0;
    for (const double error : errors) most = worse(most, error);
    const std::vector<float> found{float(errors[0]), float(errors[1]), float(errors[2])};
    const std::vector<double> truth{.1, .2, .3};
    for (const double value :
         {most, worst(errors), largest_error(found, truth, std::vector<uint8_t>(3, 0)),
          relative_l2(found, truth), row_error(found, truth, 0, 3)})
      EXPECT_FALSE(passed(Row{"", value, 1e30})) << value;
  }
  EXPECT_EQ(worse(.1, .2), .2);
  EXPECT_EQ(worse(.2, .1), .2);
  EXPECT_EQ(worst({.1, .3, .2}), .3);
}

}  // namespace
}  // namespace gflow::stress
