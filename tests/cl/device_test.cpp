// SPDX-License-Identifier: Apache-2.0
// Selection of a device, and messages about a wrong selection.
#include "runtime/cl/device.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <filesystem>
#include <functional>
#include <iostream>

#include "runtime/cl/pocl_cache.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

std::string message_of(const std::function<void()>& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

DeviceInfo large_device() {
  DeviceInfo info;
  info.platform = "P";
  info.name = "D";
  info.has_compiler = true;
  info.global_memory = 1u << 30;
  info.local_memory = 32u << 10;
  info.max_work_group = 256;
  return info;
}

TEST(Device, ListsAtLeastOneWithItsProperties) {
  const auto devices = list_devices();
  ASSERT_FALSE(devices.empty());
  EXPECT_EQ(devices[0].index, 0);
  EXPECT_FALSE(devices[0].name.empty());
  EXPECT_GT(devices[0].compute_units, 0u);
  EXPECT_GT(devices[0].max_allocation, 0u);
}

TEST(Device, IsFoundByIndexAndByPartOfItsNameInAnyCase) {
  const DeviceInfo first = list_devices()[0];
  EXPECT_EQ(device_info(find_device("0")).full_name(), first.full_name());
  std::string shouted = first.name;
  for (char& c : shouted) c = char(std::toupper(c));
  EXPECT_EQ(device_info(find_device(shouted)).name, first.name);
}

// A blank occurs in almost every device name.
TEST(Device, BlanksAloneAreNoName) {
  for (const char* blank : {" ", " \t "}) {
    const std::string message = message_of([&] { find_device(blank); });
    EXPECT_NE(message.find("not blank"), std::string::npos) << message;
    EXPECT_NE(message.find(list_devices()[0].name), std::string::npos) << message;
  }
}

TEST(Device, WrongNameIsAnsweredWithTheNamesThereAre) {
  const std::string message = message_of([] { find_device("no such device"); });
  EXPECT_NE(message.find("no OpenCL device matches 'no such device'; available: 0: "),
            std::string::npos)
      << message;
  EXPECT_NE(message.find(list_devices()[0].name), std::string::npos) << message;
}

TEST(Device, IndexOutOfRangeIsAnsweredWithTheNamesThereAre) {
  const std::string message = message_of([] { find_device("999"); });
  EXPECT_EQ(message.rfind("there is no OpenCL device 999; available:", 0), 0u) << message;
}

TEST(Device, GetsLanesOfItsVectorWidthOnCpusAndOneOnGpus) {
  DeviceInfo info;
  info.is_cpu = true;
  info.native_vector_width = 16;
  EXPECT_EQ(lanes_for(info), 16);
  info.native_vector_width = 8;
  EXPECT_EQ(lanes_for(info), 8);
  info.native_vector_width = 1;
  EXPECT_EQ(lanes_for(info), 4);
  info.platform = "rusticl";
  EXPECT_EQ(lanes_for(info), 1);
  info.is_cpu = false;
  EXPECT_EQ(lanes_for(info), 1);
}

TEST(DeviceDeathTest, WithoutADriverTheSentenceSaysWhatToInstall) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // a new process
  const Environment no_drivers("OCL_ICD_VENDORS", "/no/such/folder/");
  const auto list = [] {
    std::cerr << message_of([] { list_devices(); });
    std::exit(3);
  };
  EXPECT_EXIT(list(), testing::ExitedWithCode(3),
              "^no OpenCL device found: install a driver, on Debian e.g. `apt install "
              "pocl-opencl-icd`$");
}

// As when a memory limit prevents the loader from loading the driver.
TEST(DeviceDeathTest, ADriverThatIsThereAndHasNoDeviceIsNamed) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const TemporaryFolder folder;
  folder.write("mine.icd", "/no/such/driver.so\n");
  const Environment drivers("OCL_ICD_VENDORS", folder.path());
  const auto list = [] {
    std::cerr << message_of([] { list_devices(); });
    std::exit(3);
  };
  EXPECT_EXIT(list(), testing::ExitedWithCode(3),
              "^no OpenCL device found: install .*mine.icd in /.*ulimit -v, -n");
}

TEST(DeviceDeathTest, WhereOnesProgramsCannotBeKeptThatIsTheReason) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment no_drivers("OCL_ICD_VENDORS", "/no/such/folder/");  // even with PoCL
  const Environment no_cache("POCL_CACHE_DIR", "/proc/programs");
  const auto list = [] {
    std::cerr << message_of([] { list_devices(); });
    std::exit(3);
  };
  EXPECT_EXIT(list(), testing::ExitedWithCode(3),
              "cannot create the folder /proc/programs given by POCL_CACHE_DIR");
}

TEST(DeviceDeathTest, AFolderForProgramsThatCannotBeWrittenIsTheReason) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() + "/programs");
  ASSERT_EQ(chmod(folder.path().c_str(), 0755), 0);
  ASSERT_EQ(chmod((folder.path() + "/programs").c_str(), 0555), 0);
  const Environment no_drivers("OCL_ICD_VENDORS", "/no/such/folder/");
  const Environment no_cache("POCL_CACHE_DIR", folder.path() + "/programs");
  const auto list = [] {
    if (getuid() == 0 && setuid(65534) != 0) std::exit(4);  // root may write anywhere
    std::cerr << message_of([] { list_devices(); });
    std::exit(3);
  };
  EXPECT_EXIT(list(), testing::ExitedWithCode(3),
              "POCL_CACHE_DIR is .*/programs, which is not writable");
}

// If PoCL is not what is missing, its folder is not a reason.
TEST(DeviceDeathTest, AHomeThatCannotBeWrittenIsNotTheOnlyReason) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Environment no_drivers("OCL_ICD_VENDORS", "/no/such/folder/");
  const Environment no_cache("POCL_CACHE_DIR", "");
  const Environment no_all("XDG_CACHE_HOME", "/dev/null");
  const auto list = [] {
    std::cerr << message_of([] { list_devices(); });
    std::exit(3);
  };
  EXPECT_EXIT(list(), testing::ExitedWithCode(3),
              "install a driver, .*; if one is installed: PoCL's cache folder is /dev/null/pocl");
}

TEST(PoclCache, TheFolderIsTheUsersAndItsRoomIsKnown) {
  const TemporaryFolder folder;
  const Environment own("POCL_CACHE_DIR", folder.path());
  constexpr uint64_t endless = uint64_t{1} << 62;
  EXPECT_EQ(pocl_cache_problem(0), "");
  EXPECT_NE(
      pocl_cache_problem(endless).find("POCL_CACHE_DIR is " + folder.path() + ", which has only"),
      std::string::npos);
  const Environment none("POCL_CACHE_DIR", "");
  const Environment all("XDG_CACHE_HOME", folder.path());
  EXPECT_EQ(pocl_cache_problem(0), "");
  EXPECT_NE(pocl_cache_problem(endless).find("cache folder is " + folder.path() +
                                             "/pocl/kcache, which has"),
            std::string::npos);
  const Environment no_all("XDG_CACHE_HOME", "");
  const Environment home("HOME", "/proc/nothing");
  EXPECT_NE(
      pocl_cache_problem(endless).find("cache folder is /proc/nothing/.cache/pocl/kcache, which"),
      std::string::npos);
}

TEST(Device, TooSmallOneIsRefusedWithTheReason) {
  EXPECT_NO_THROW(require_usable(large_device(), 1));
  DeviceInfo info = large_device();
  info.global_memory = 100u << 20;
  EXPECT_EQ(message_of([&] { require_usable(info, 16); }),
            "the OpenCL device P / D cannot be used: it has 100 MiB of memory, at least 256 MiB "
            "are needed");
  info = large_device();
  info.has_compiler = false;
  EXPECT_EQ(message_of([&] { require_usable(info, 16); }),
            "the OpenCL device P / D cannot be used: its driver has no OpenCL C compiler");
}

TEST(Device, LocalMemoryMattersOnlyWhereAPixelIsAWorkItem) {
  DeviceInfo info = large_device();
  info.local_memory = 16u << 10;
  EXPECT_NO_THROW(require_usable(info, 4));
  EXPECT_NE(message_of([&] { require_usable(info, 1); }).find("bytes of local memory"),
            std::string::npos);
}

TEST(Device, OneOfSmallWorkGroupsIsRefused) {
  DeviceInfo info = large_device();
  info.max_work_group = 128;
  EXPECT_NO_THROW(require_usable(info, 8));
  EXPECT_EQ(message_of([&] { require_usable(info, 1); }),
            "the OpenCL device P / D cannot be used: its work-groups have at most 128 work-items, "
            "256 are needed");
  info.max_work_group = 32;
  EXPECT_EQ(
      message_of([&] { require_usable(info, 8); }),
      "the OpenCL device P / D cannot be used: its work-groups have at most 32 work-items, 64 are "
      "needed");
}

}  // namespace
}  // namespace gflow
