// SPDX-License-Identifier: Apache-2.0
// Device discovery. Platforms without devices are not an error: Mesa installs some.
#include "runtime/cl/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <csignal>
#include <cstdlib>
#include <filesystem>

#include "runtime/base/lower.hpp"
#include "runtime/cl/pocl_cache.hpp"

namespace gflow {
namespace {

// The drivers that the OpenCL loader finds; "" if none.
std::string drivers_named() {
  const char* const chosen = std::getenv("OCL_ICD_VENDORS");
  const std::filesystem::path vendors = chosen && *chosen ? chosen : "/etc/OpenCL/vendors";
  if (vendors.extension() == ".icd") return vendors.string();
  std::string names;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(vendors, none))
    if (entry.path().extension() == ".icd")
      names += (names.empty() ? "" : ", ") + entry.path().filename().string();
  return names.empty() ? "" : fmt::format("{} in {}", names, vendors.string());
}

// Without a folder for its programs PoCL has no device, so that reason is checked, too.
std::string no_device_message() {
  const char* const cache = std::getenv("POCL_CACHE_DIR");
  const std::string install = "install a driver, on Debian e.g. `apt install pocl-opencl-icd`";
  std::error_code problem;
  std::string why = pocl_cache_problem(0);
  if (why.empty() && cache && *cache && !std::filesystem::is_directory(cache, problem))
    return fmt::format(  // as root, e.g. in /proc
        "no OpenCL device found: cannot create the folder {} given by POCL_CACHE_DIR; unset the "
        "variable or set it to a writable folder",
        cache);
  if (why.empty()) why = compile_failure_reason();
  if (const std::string drivers = drivers_named(); why.empty() && !drivers.empty())
    return fmt::format(
        "no OpenCL device found: {}; if an installed driver ({}) should provide one, a limit on "
        "memory or open files (ulimit -v, -n) may prevent it",
        install, drivers);
  if (why.empty()) return "no OpenCL device found: " + install;
  return cache && *cache
             ? "no OpenCL device found: " + why
             : fmt::format("no OpenCL device found: {}; if one is installed: {}", install, why);
}

// Restores the program's signal handlers. PoCL's LLVM replaces them when its platform is first
// queried: a signal that was ignored (nohup) would end the program.
class KeepSignals {
 public:
  KeepSignals() {
    for (int signal = 1; signal < kSignals; ++signal)
      known_[signal] = ::sigaction(signal, nullptr, &actions_[signal]) == 0;
  }
  ~KeepSignals() {
    for (int signal = 1; signal < kSignals; ++signal)
      if (known_[signal]) ::sigaction(signal, &actions_[signal], nullptr);
  }
  KeepSignals(const KeepSignals&) = delete;
  KeepSignals& operator=(const KeepSignals&) = delete;

 private:
  static constexpr int kSignals = 32;
  struct sigaction actions_[kSignals] = {};
  bool known_[kSignals] = {};
};

std::vector<cl::Device> all_devices() {
  const KeepSignals keep;
  // PoCL searches PATH for the linker and ends the program if it is not set, as in some services.
  ::setenv("PATH", "/usr/local/bin:/usr/bin:/bin", 0);
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    throw Error(no_device_message());  // without drivers the loader returns an error (-1001)
  }
  std::vector<cl::Device> all;
  for (const auto& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {
      continue;
    }
    all.insert(all.end(), devices.begin(), devices.end());
  }
  if (all.empty()) throw Error(no_device_message());
  return all;
}

bool is_index(const std::string& text) {
  return !text.empty() && text.size() < 6 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
}

// On one line, as all messages are.
std::string listing(const std::vector<DeviceInfo>& infos) {
  std::string text;
  for (const auto& info : infos)
    text += fmt::format("{} {}: {}", info.index > 0 ? "," : "", info.index, info.full_name());
  return text;
}

std::vector<DeviceInfo> infos_of(const std::vector<cl::Device>& devices) {
  std::vector<DeviceInfo> infos;
  for (const auto& device : devices) infos.push_back(device_info(device, int(infos.size())));
  return infos;
}

std::string megabytes(uint64_t bytes) { return fmt::format("{} MiB", bytes >> 20); }

}  // namespace

DeviceInfo device_info(const cl::Device& device, int index) {
  return cl_call("querying the properties of an OpenCL device", [&] {
    DeviceInfo info;
    info.index = index;
    info.platform = cl::Platform(device.getInfo<CL_DEVICE_PLATFORM>()).getInfo<CL_PLATFORM_NAME>();
    info.name = device.getInfo<CL_DEVICE_NAME>();
    info.driver = device.getInfo<CL_DRIVER_VERSION>();
    info.version = device.getInfo<CL_DEVICE_VERSION>();
    const auto type = device.getInfo<CL_DEVICE_TYPE>();
    info.is_cpu = type & CL_DEVICE_TYPE_CPU;
    info.is_gpu = type & CL_DEVICE_TYPE_GPU;
    info.fp64 = device.getInfo<CL_DEVICE_EXTENSIONS>().find("cl_khr_fp64") != std::string::npos;
    info.has_compiler = device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>();
    info.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
    info.global_memory = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
    info.max_allocation = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    info.local_memory = device.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>();
    info.max_work_group = device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>();
    info.native_vector_width = int(device.getInfo<CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT>());
    info.lanes = lanes_for(info);
    return info;
  });
}

bool is_pocl(const DeviceInfo& info) { return info.platform == "Portable Computing Language"; }

int lanes_for(const DeviceInfo& info) {
  if (!info.is_cpu) return 1;                     // a GPU's lanes are its work-items
  if (info.platform == "rusticl") return 1;       // compiling vectors takes it minutes
  if (info.native_vector_width >= 16) return 16;  // AVX-512: a 4x4 cell is one register
  if (info.native_vector_width >= 8) return 8;    // AVX2
  return 4;                                       // SSE, NEON; scalar CPUs do not lose by it
}

std::vector<DeviceInfo> list_devices() { return infos_of(all_devices()); }

cl::Device find_device(const std::string& wanted_or_empty) {
  const auto devices = all_devices();
  const auto infos = infos_of(devices);
  std::string wanted = wanted_or_empty;
  if (const char* named = std::getenv("GFLOW_DEVICE"); wanted.empty() && named) wanted = named;
  if (!wanted.empty() && wanted.find_first_not_of(" \t") == wanted.npos)  // would match any name
    throw Error(
        fmt::format("the OpenCL device must be an index or part of a name, not blank; available:{}",
                    listing(infos)));
  if (wanted.empty()) {
    const auto gpu =
        std::find_if(infos.begin(), infos.end(), [](const DeviceInfo& d) { return d.is_gpu; });
    return gpu == infos.end() ? devices.front() : devices[size_t(gpu->index)];
  }
  if (is_index(wanted)) {
    const size_t index = std::stoul(wanted);
    if (index < devices.size()) return devices[index];
    throw Error(fmt::format("there is no OpenCL device {}; available:{}", wanted, listing(infos)));
  }
  for (const auto& info : infos)
    if (lower(info.full_name()).find(lower(wanted)) != std::string::npos)
      return devices[size_t(info.index)];
  throw Error(fmt::format("no OpenCL device matches '{}'; available:{}", wanted, listing(infos)));
}

void require_usable(const DeviceInfo& info, int lanes) {
  const auto refuse = [&](const std::string& reason) {
    throw Error(fmt::format("the OpenCL device {} cannot be used: {}", info.full_name(), reason));
  };
  const uint64_t least_memory = 256u << 20, least_local = 24u << 10;
  const size_t least_group = lanes == 1 ? 256 : 64;  // one work-item per pixel of a 16x16 tile
  if (!info.has_compiler) refuse("its driver has no OpenCL C compiler");
  if (info.global_memory < least_memory)
    refuse(fmt::format("it has {} of memory, at least {} are needed", megabytes(info.global_memory),
                       megabytes(least_memory)));
  if (info.max_work_group < least_group)
    refuse(fmt::format("its work-groups have at most {} work-items, {} are needed",
                       info.max_work_group, least_group));
  if (lanes != 1) return;  // vector kernels need no local memory
  if (info.local_memory < least_local)
    refuse(fmt::format("it has {} bytes of local memory, {} are needed", info.local_memory,
                       least_local));
}

}  // namespace gflow
