// SPDX-License-Identifier: Apache-2.0
// Building kernel files: includes, defines, the cache on disk, and error messages. The tests write
// their kernel files to a folder that GFLOW_KERNEL_DIR names.
#include "runtime/cl/program.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "runtime/cl/kernel.hpp"
#include "tests/support/device.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// A folder of kernel files that replaces the embedded ones, and an empty program cache.
struct KernelFolder {
  void write(const std::string& file, const std::string& text) const { folder.write(file, text); }
  std::vector<fs::path> cached() const {
    std::vector<fs::path> files;
    if (fs::exists(cache_path()))
      for (const auto& entry : fs::directory_iterator(cache_path())) files.push_back(entry.path());
    return files;
  }
  fs::path cache_path() const { return fs::path(folder.path()) / "cache" / "deep"; }

  TemporaryFolder folder;
  Environment kernels{"GFLOW_KERNEL_DIR", folder.path()};
  Environment cache{"GFLOW_CACHE_DIR", cache_path().string()};
};

const char* const value_kernel =
    "kernel void value(global uint* restrict out) { out[0] = VALUE; }\n";

cl_uint run_value(Queue& queue, const Program& program) {
  Buffer<cl_uint> out(queue, 1, "out");
  Kernel<Out<cl_uint>>(program, "value")(queue, Range::groups(1, 1), out);
  return out.read(queue)[0];
}

std::string build_error(const std::string& file) {
  Queue queue = test_queue();
  try {
    Program program(queue, file);
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(ExpandIncludes, ReplacesEachIncludeOnceAndMarksLines) {
  const KernelFolder folder;
  folder.write("a.cl", "#include \"shared/b.h\"\n#include \"shared/b.h\"\nint a;\n");
  folder.write("shared/b.h", "#include \"only_for_cpp.hpp\"\nint b;\n");
  EXPECT_EQ(expand_includes("a.cl"),
            "#line 1 \"a.cl\"\n"
            "#line 1 \"shared/b.h\"\n#line 2 \"shared/b.h\"\nint b;\n"
            "#line 2 \"a.cl\"\n#line 3 \"a.cl\"\nint a;\n");
}

TEST(Program, FindsItsEmbeddedFilesWithoutAFolder) {
  EXPECT_NE(expand_includes("primitives/adam.cl").find("adam_update"), std::string::npos);
}

// As a loss or a motion model outside of gflow brings its kernel.
TEST(Program, FindsRegisteredFilesThatIncludeItsOwn) {
  register_kernel("outside/value.cl", std::string("#include \"shared/arrays.h\"\n") + value_kernel);
  Queue queue = test_queue();
  EXPECT_EQ(run_value(queue, Program(queue, "outside/value.cl", {{"VALUE", 9}})), 9u);
  expect_error([] { register_kernel("outside/value.cl", ""); }, {"outside/value.cl", "already"});
  expect_error([] { register_kernel("primitives/adam.cl", ""); }, {"adam.cl", "already"});
}

TEST(Program, MissingFileIsNamed) {
  EXPECT_EQ(build_error("no_such.cl"), "there is no kernel file no_such.cl");
}

TEST(Program, FailedBuildGivesOptionsFileAndTheCompilersLog) {
  const KernelFolder folder;
  folder.write("bad.cl", "kernel void f(global int* x) {\n  x[0] = unknown_word;\n}\n");
  const std::string message = build_error("bad.cl");
  EXPECT_EQ(message.find("building bad.cl with -cl-std=CL1.2 -w -cl-kernel-arg-info -DLANES="), 0u)
      << message;
  EXPECT_NE(message.find("clBuildProgram returned CL_BUILD_PROGRAM_FAILURE (-11)"),
            std::string::npos)
      << message;
  EXPECT_NE(message.find("unknown_word"), std::string::npos) << message;
}

TEST(Program, DefinesReachTheKernel) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  Queue queue = test_queue();
  EXPECT_EQ(run_value(queue, Program(queue, "value.cl", {{"VALUE", 7}})), 7u);
  EXPECT_EQ(run_value(queue, Program(queue, "value.cl", {{"VALUE", "(4+4)"}})), 8u);
}

TEST(Program, IsCompiledOnceAQueue) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  Queue queue = test_queue();
  const Program first(queue, "value.cl", {{"VALUE", 7}});
  EXPECT_EQ(Program(queue, "value.cl", {{"VALUE", 7}}).handle(), first.handle());
  EXPECT_NE(Program(queue, "value.cl", {{"VALUE", 8}}).handle(), first.handle());
}

TEST(ProgramCache, AChangedFileIsAnotherProgram) {
  const KernelFolder folder;
  for (const cl_uint value : {3u, 4u}) {
    folder.write("value.cl", "#define VALUE " + std::to_string(value) + "\n" + value_kernel);
    Queue queue = test_queue();
    EXPECT_EQ(run_value(queue, Program(queue, "value.cl")), value);
  }
}

// The result of value.cl, built by a new queue as in another process.
uint32_t build_and_run(int value = 5) {
  Queue queue = test_queue();
  return run_value(queue, Program(queue, "value.cl", {{"VALUE", value}}));
}

TEST(ProgramCache, UnsoundFilesAreReplacedSilently) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  EXPECT_EQ(build_and_run(), 5u);
  const auto files = folder.cached();
  for (const std::string& damage : {std::string(), std::string("nonsense"), std::string(9999, 'x')})
    for (const auto& file : files) {
      std::ofstream(file, std::ios::binary) << damage;
      EXPECT_EQ(build_and_run(), 5u);
    }
  for (const auto& file : files) {  // valid except for one byte of the driver's part
    std::fstream(file, std::ios::binary | std::ios::in | std::ios::out).seekp(200) << '\x7f';
    EXPECT_EQ(build_and_run(), 5u);
  }
  EXPECT_EQ(folder.cached().size(), files.size());  // no temporaries are left behind
}

TEST(ProgramCache, AnotherProgramsFileIsNotTaken) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  EXPECT_EQ(build_and_run(5), 5u);
  const fs::path five = folder.cached().at(0);
  EXPECT_EQ(build_and_run(6), 6u);
  for (const fs::path& file : folder.cached())
    if (file != five) fs::copy_file(five, file, fs::copy_options::overwrite_existing);
  EXPECT_EQ(build_and_run(6), 6u);
}

TEST(ProgramCache, AFileThatCannotBeReplacedLeavesNoDraft) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  EXPECT_EQ(build_and_run(), 5u);
  const fs::path file = folder.cached().at(0);
  fs::remove(file);
  fs::create_directory(file);
  EXPECT_EQ(build_and_run(), 5u);
  EXPECT_EQ(folder.cached(), std::vector<fs::path>{file});
}

TEST(ProgramCache, AFolderThatCannotBeWrittenIsNoError) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  for (const std::string& place :
       {folder.folder.path() + "/value.cl/x", std::string("/dev/null")}) {
    const Environment cache("GFLOW_CACHE_DIR", place);
    Queue queue = test_queue();
    EXPECT_EQ(run_value(queue, Program(queue, "value.cl", {{"VALUE", 5}})), 5u) << place;
  }
}

TEST(ProgramCache, EmptyFolderNameSwitchesItOff) {
  const KernelFolder folder;
  folder.write("value.cl", value_kernel);
  const Environment cache("GFLOW_CACHE_DIR", "");
  Queue queue = test_queue();
  EXPECT_EQ(run_value(queue, Program(queue, "value.cl", {{"VALUE", 5}})), 5u);
  EXPECT_TRUE(folder.cached().empty());
}

}  // namespace
}  // namespace gflow
