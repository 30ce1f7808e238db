// SPDX-License-Identifier: Apache-2.0
// Typed kernels: a declaration that differs from the kernel is rejected; launch errors name the
// kernel.
#include "runtime/cl/kernel.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/device.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

struct TestPair {
  cl_int a;
  cl_float b;
};
GFLOW_KERNEL_STRUCT(TestPair);

namespace gflow {
namespace {

const char* const text = R"(
typedef struct TestPair { int a; float b; } TestPair;
kernel void all_types(const uint n, const float f, const int i, const ulong l, const TestPair pair,
                      global const uchar* restrict c, global const ushort* restrict s,
                      global const int* restrict in, global float* restrict out,
                      global ulong* restrict big) {
  const uint k = get_global_id(0);
  if (k >= n) return;
  out[k] = f * c[k] + s[k] + in[k] + i + pair.a * pair.b;
  big[k] = l + k;
}
kernel void mark(const uint width, const uint height, global uint* restrict out) {
  const uint x = get_global_id(0), y = get_global_id(1);
  if (x < width && y < height) out[y * width + x] += 1 + x + 100 * y;
}
)";

using AllTypes = Kernel<cl_uint, cl_float, cl_int, cl_ulong, TestPair, In<cl_uchar>, In<cl_ushort>,
                        In<cl_int>, Out<float>, Out<cl_ulong>>;

struct KernelFixture {
  explicit KernelFixture(const QueueOptions& options = {}) : queue(find_device(), options) {
    folder.write("test.cl", text);
  }
  Program program() { return Program(queue, "test.cl"); }
  TemporaryFolder folder;
  Environment kernels{"GFLOW_KERNEL_DIR", folder.path()};
  Environment cache{"GFLOW_CACHE_DIR", ""};
  Queue queue;
};

template <class K>
std::string signature_error(const std::string& name) {
  KernelFixture f;
  try {
    K kernel(f.program(), name);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Kernel, PassesEveryKindOfArgument) {
  KernelFixture f;
  Buffer<cl_uchar> c(f.queue, {1, 2, 3}, "c");
  Buffer<cl_ushort> s(f.queue, {10, 20, 30}, "s");
  Buffer<cl_int> in(f.queue, {-1, -2, -3}, "in");
  Buffer<float> out(f.queue, 3, "out");
  Buffer<cl_ulong> big(f.queue, 3, "big");
  AllTypes kernel(f.program(), "all_types");
  kernel(f.queue, Range::over(3), 3, 100, 1000, cl_ulong(1) << 40, {2, .25f}, c, s, in, out, big);
  EXPECT_EQ(out.read(f.queue), (std::vector<float>{1109.5f, 1218.5f, 1327.5f}));
  EXPECT_EQ(big.read(f.queue)[2], (cl_ulong(1) << 40) + 2);
}

TEST(Kernel, CoversAGridOnce) {
  KernelFixture f;
  Buffer<cl_uint> out(f.queue, {0, 0, 0, 0, 0, 0}, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>> mark(f.program(), "mark");
  mark(f.queue, Range::grid(3, 2, 8, 4), 3, 2, out);
  EXPECT_EQ(out.read(f.queue), (std::vector<cl_uint>{1, 2, 3, 101, 102, 103}));
}

TEST(Kernel, DoesNothingOverAnEmptyRange) {
  KernelFixture f;
  Buffer<cl_uint> out(f.queue, {5}, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>> mark(f.program(), "mark");
  mark(f.queue, Range::over(0), 0, 0, out);
  EXPECT_EQ(out.read(f.queue), std::vector<cl_uint>{5});
}

TEST(Kernel, MistypedArgumentIsNamed) {
  using Wrong = Kernel<cl_uint, cl_uint, Out<float>>;
  EXPECT_EQ(signature_error<Wrong>("mark"),
            "kernel mark, argument 2 'out': the kernel takes global uint*, its host declaration "
            "has global float*");
}

TEST(Kernel, ReadingWhatTheKernelWritesIsRefused) {
  using Wrong = Kernel<cl_uint, cl_uint, In<cl_uint>>;
  EXPECT_EQ(signature_error<Wrong>("mark"),
            "kernel mark, argument 2 'out': the kernel takes global uint*, its host declaration "
            "has global const uint*");
}

TEST(Kernel, MissingArgumentIsCounted) {
  EXPECT_EQ(signature_error<Kernel<cl_uint>>("mark"),
            "kernel mark takes 3 arguments, its host declaration has 1");
}

TEST(Kernel, MissingKernelIsNamed) {
  EXPECT_EQ(signature_error<Kernel<cl_uint>>("nothing"),
            "finding kernel nothing in test.cl: clCreateKernel returned CL_INVALID_KERNEL_NAME "
            "(-46)");
}

TEST(Kernel, FailedLaunchNamesKernelAndRange) {
  KernelFixture f;
  Buffer<cl_uint> out(f.queue, 1, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>> mark(f.program(), "mark");
  const size_t too_many = f.queue.info.max_work_group * 2;
  try {
    mark(f.queue, Range::groups(1, too_many), 0, 0, out);
    FAIL() << "launched";
  } catch (const ClError& error) {
    const std::string expected =
        fmt::format("launching mark on {0} work-items in groups of {0}: ", too_many);
    EXPECT_EQ(std::string(error.what()).rfind(expected, 0), 0u) << error.what();
  }
}

TEST(Queue, CountsLaunchesWhenProfiling) {
  QueueOptions options;
  options.profile = true;
  KernelFixture f(options);
  Buffer<cl_uint> out(f.queue, {0}, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>> mark(f.program(), "mark");
  for (int i = 0; i < 5000; ++i) mark(f.queue, Range::groups(1, 1), 1, 1, out);
  const auto timings = f.queue.timings();
  if (!timings.empty()) {  // empty if the driver reports no times
    EXPECT_EQ(timings.at("mark").count, 5000u);
    EXPECT_GE(timings.at("mark").total_ms, 0);
  }
  EXPECT_EQ(out.read(f.queue)[0], 5000u);
  f.queue.reset_timings();
  EXPECT_TRUE(f.queue.timings().empty());
}

TEST(Queue, KeepsNoTimingsUnlessAsked) {
  KernelFixture f;
  Buffer<cl_uint> out(f.queue, {0}, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>>(f.program(), "mark")(f.queue, Range::groups(1, 1), 1, 1,
                                                              out);
  EXPECT_TRUE(f.queue.timings().empty());
}

TEST(Queue, RefusesALaneCountThatNoKernelHas) {
  QueueOptions options;
  options.lanes = 3;
  try {
    Queue queue(find_device(), options);
    FAIL() << "made";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "lanes is 3; it must be 1, 4, 8 or 16 (0 = chosen for the device)");
  }
}

TEST(Queue, FinishesEachLaunchOnRequestWithTheSameResult) {
  const Environment sync("GFLOW_SYNC", "1");
  KernelFixture f;
  Buffer<cl_uint> out(f.queue, {0}, "out");
  Kernel<cl_uint, cl_uint, Out<cl_uint>> mark(f.program(), "mark");
  mark(f.queue, Range::groups(1, 1), 1, 1, out);
  mark(f.queue, Range::groups(1, 1), 1, 1, out);
  EXPECT_EQ(out.read(f.queue)[0], 2u);
}

}  // namespace
}  // namespace gflow
