// SPDX-License-Identifier: Apache-2.0
// The quick stress tests (apps/stress), one test case each; `gflow stress --quick` prints them as a
// table.
#include "apps/stress/stress.hpp"

#include <gtest/gtest.h>

#include <regex>
#include <set>

#include "runtime/cl/kernel_sources.hpp"
#include "tests/support/device.hpp"

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
        << row.condition << ": " << row.value << " exceeds " << row.bound;
}

INSTANTIATE_TEST_SUITE_P(Numerics, Stress, testing::ValuesIn(quick_tests()),
                         [](const testing::TestParamInfo<stress::Test>& info) {
                           std::string name = info.param.id + "_" + info.param.name;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

// Names of the kernels that compute gradients: they end with _bwd, or write to a parameter named v_
// or gradient_sums (the gradients that velocities would have).
std::set<std::string> gradient_kernels() {
  std::set<std::string> names;
  const std::regex head(R"(kernel void (\w+)\(([^)]*)\))");
  const std::regex written(R"(global \w+\* restrict (v_\w+|gradient_sums))");
  for (const auto& [file, text] : kernel_sources())
    for (std::sregex_iterator it(text.begin(), text.end(), head), end; it != end; ++it) {
      const std::string name = (*it)[1],
                        parameters = std::regex_replace((*it)[2].str(), std::regex("global const"),
                                                        "constant");
      const bool bwd = name.size() > 4 && name.compare(name.size() - 4, 4, "_bwd") == 0;
      if (bwd || std::regex_search(parameters, written)) names.insert(name);
    }
  return names;
}

// With the device's own lanes and as on GPUs, because some kernels exist for one of them only.
TEST(Derivatives, EveryDerivativeIsThatOfItsFunction) {
  std::set<std::string> missing = gradient_kernels();
  EXPECT_GT(missing.size(), 20u);
  for (const int lanes : {0, 1}) {
    QueueOptions options;
    options.profile = true;
    options.lanes = lanes;
    Queue queue(find_device(), options);
    for (const stress::Derivative& d : stress::derivatives(queue))
      EXPECT_TRUE(stress::passed(d)) << d.kernel << " by " << d.parameters << ", " << queue.lanes
                                     << " lanes: " << d.against_double << " to double, "
                                     << d.against_differences << " to differences";
    for (const auto& [name, timing] : queue.timings()) missing.erase(name);
  }
  missing.erase("replay_bwd");         // T18: counts only, differentiates nothing
  missing.erase("weighted_gradient");  // multiplies by constants (pixel_weights_test)
  for (const std::string& name : missing)
    ADD_FAILURE() << "no row of the table of derivatives runs kernel " << name;
}

}  // namespace
}  // namespace gflow
