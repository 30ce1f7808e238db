// SPDX-License-Identifier: Apache-2.0
// The quick stress tests (apps/stress), one case each: what `gflow stress --quick` shows as a
// table.
#include "apps/stress/stress.hpp"

#include <gtest/gtest.h>

#include "device.hpp"

namespace gflow {
namespace {

stress::Tests quick_tests() {
  stress::Tests quick;
  for (stress::Test& test : stress::all_tests())
    if (test.quick) quick.push_back(std::move(test));
  return quick;
}

class Stress : public testing::TestWithParam<stress::Test> {};

TEST_P(Stress, KeepsItsBounds) {
  Queue queue = test_queue();
  const stress::Rows rows = GetParam().run(queue);
  EXPECT_FALSE(rows.empty());
  for (const stress::Row& row : rows)
    EXPECT_TRUE(stress::passed(row))
        << row.condition << ": " << row.figure << " exceeds " << row.bound;
}

INSTANTIATE_TEST_SUITE_P(Numerics, Stress, testing::ValuesIn(quick_tests()),
                         [](const testing::TestParamInfo<stress::Test>& info) {
                           std::string name = info.param.id + "_" + info.param.name;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

TEST(Derivatives, EveryDerivativeIsThatOfItsFunction) {
  Queue queue = test_queue();
  for (const stress::Derivative& d : stress::derivatives(queue))
    EXPECT_TRUE(stress::passed(d)) << d.kernel << " by " << d.parameters << ": " << d.against_double
                                   << " to double, " << d.against_differences << " to differences";
}

}  // namespace
}  // namespace gflow
