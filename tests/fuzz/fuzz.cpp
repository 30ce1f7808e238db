// SPDX-License-Identifier: Apache-2.0
// libFuzzer's entry points. GFLOW_FUZZ_TARGET selects the reader. `fuzz --seeds FOLDER` writes
// valid inputs of each reader to FOLDER/NAME instead, and `fuzz --long MB` feeds files of that
// size.
#include <sanitizer/allocator_interface.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "tests/fuzz/targets.hpp"
#include "tests/support/temporary_folder.hpp"

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

// Allocated memory of the whole process, and its maximum since `most` was set [bytes].
std::atomic<long> allocated{0}, most{0};

void count_malloc(const volatile void*, size_t size) {
  const long now = allocated += long(size);
  long before = most;
  while (now > before && !most.compare_exchange_weak(before, now)) {
  }
}
void count_free(const volatile void* place) {
  allocated -= long(__sanitizer_get_allocated_size(place));
}

void read_counted(const uint8_t* bytes, size_t size) {
  const long before = allocated;
  most = before;
  chosen().read(bytes, size);
  const size_t taken = size_t(most - before);
  if (taken > gflow::fuzz::memory_allowed(chosen(), bytes, size)) {
    std::fprintf(stderr, "fuzz: reading %zu bytes took %zu MB of memory\n", size, taken >> 20);
    std::abort();
  }
}

void write_seeds(const std::string& to) {
  for (const auto& target : gflow::fuzz::targets()) {
    const std::string folder = to + "/" + target.name;
    std::filesystem::create_directories(folder);
    target.make_seeds(folder);
    if (std::filesystem::is_empty(folder)) {
      std::fprintf(stderr, "fuzz: target %s has no seed\n", target.name);
      std::exit(1);
    }
    std::printf("%s\n", target.name);
  }
}

void read_long_files(size_t size) {
  const TemporaryFolder seeds;
  chosen().make_seeds(seeds.path());
  gflow::fuzz::for_long_files(seeds.path(), size, [&](const std::string& what, const auto& input) {
    std::fprintf(stderr, "%s: %s\n", chosen().name, what.c_str());
    read_counted(reinterpret_cast<const uint8_t*>(input.data()), input.size());
  });
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::string word = *argc > 2 ? (*argv)[1] : "";
  if (word == "--seeds") {
    write_seeds((*argv)[2]);
    std::exit(0);
  }
  chosen().read(nullptr, 0);  // allocates what is made once, which does not count
  __sanitizer_install_malloc_and_free_hooks(count_malloc, count_free);
  if (word == "--long") {
    read_long_files(std::strtoul((*argv)[2], nullptr, 10) << 20);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  read_counted(bytes, size);
  return 0;
}
