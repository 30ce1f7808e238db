// SPDX-License-Identifier: Apache-2.0
// libFuzzer's entry points. GFLOW_FUZZ_TARGET names the reader; `fuzz --seeds FOLDER` writes valid
// inputs of each into FOLDER/NAME instead.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "fuzz/targets.hpp"

namespace {

const gflow::fuzz::Target& chosen() {
  static const gflow::fuzz::Target* const target = [] {
    const char* name = std::getenv("GFLOW_FUZZ_TARGET");
    for (const auto& one : gflow::fuzz::targets())
      if (name && std::strcmp(one.name, name) == 0) return &one;
    std::fprintf(stderr, "fuzz: set GFLOW_FUZZ_TARGET to the name of a target\n");
    std::exit(1);
  }();
  return *target;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc < 3 || std::strcmp((*argv)[1], "--seeds") != 0) return 0;
  for (const auto& target : gflow::fuzz::targets()) {
    const std::string folder = std::string((*argv)[2]) + "/" + target.name;
    std::filesystem::create_directories(folder);
    target.make_seeds(folder);
    if (std::filesystem::is_empty(folder)) {
      std::fprintf(stderr, "fuzz: target %s has no seed\n", target.name);
      std::exit(1);
    }
    std::printf("%s\n", target.name);
  }
  std::exit(0);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  chosen().read(bytes, size);
  return 0;
}
