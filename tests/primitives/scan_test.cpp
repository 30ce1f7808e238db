// SPDX-License-Identifier: Apache-2.0
// Prefix sums against std::partial_sum, in both work-group shapes (lanes 0: the device's own,
// lanes 1: a GPU's).
#include "runtime/primitives/scan.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

struct Scanned {
  std::vector<cl_uint> out;
  uint64_t total;
};

Scanned scanned(const std::vector<cl_uint>& data, int lanes) {
  Queue queue = test_queue(lanes);
  Scan scan(queue);
  Buffer<cl_uint> in(queue, data, "in"), out("out");
  scan.exclusive(queue, in, out, data.size());
  return {out.read(queue), scan.total(queue)};
}

class ScanTest : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, ScanTest, testing::Values(0, 1));

TEST_P(ScanTest, SumsAnEmptyArrayToZero) {
  const Scanned s = scanned({}, GetParam());
  EXPECT_EQ(s.out, std::vector<cl_uint>{0});
  EXPECT_EQ(s.total, 0u);
}

TEST_P(ScanTest, SumsThreeNumbers) {
  EXPECT_EQ(scanned({5, 0, 7}, GetParam()).out, (std::vector<cl_uint>{0, 5, 5, 12}));
}

TEST_P(ScanTest, AgreesWithTheStandardLibraryAtAnyLength) {
  std::mt19937 rng(1);
  for (const size_t n : {1u, 255u, 256u, 257u, 1023u, 2048u, 10000u, 300001u}) {
    std::vector<cl_uint> data(n), expected(n + 1, 0);
    for (cl_uint& x : data) x = rng() % 1000;
    std::partial_sum(data.begin(), data.end(), expected.begin() + 1);
    EXPECT_EQ(scanned(data, GetParam()).out, expected) << n;
  }
}

TEST_P(ScanTest, TotalDoesNotOverflow) {
  const Scanned s = scanned(std::vector<cl_uint>(5000, 0xffffffffu), GetParam());
  EXPECT_EQ(s.total, uint64_t(5000) * 0xffffffffu);
}

TEST_P(ScanTest, SumsOnlyTheFirstNOfALongerArrayAndCanBeReused) {
  Queue queue = test_queue(GetParam());
  Scan scan(queue);
  Buffer<cl_uint> in(queue, {1, 2, 3, 4}, "in"), out("out");
  scan.exclusive(queue, in, out, 4);
  scan.exclusive(queue, in, out, 2);
  EXPECT_EQ(out.read(queue), (std::vector<cl_uint>{0, 1, 3}));
  EXPECT_EQ(scan.total(queue), 3u);
  EXPECT_THROW(scan.exclusive(queue, in, out, 5), Error);
}

}  // namespace
}  // namespace gflow
