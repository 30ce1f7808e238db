// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/targets.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <limits>

#include "tests/support/temporary_folder.hpp"

namespace gflow::fuzz {

Holds its_size(const uint8_t*, size_t) { return Holds::its_size; }
Holds packed_file(const uint8_t*, size_t) { return Holds::packed; }
Holds any_video(const uint8_t*, size_t) { return Holds::anything; }

const std::vector<Target>& targets() {
  static const std::vector<Target> all = [] {
    std::vector<Target> joined;
    for (const auto& some :
         {splat_targets(), file_targets(), scene_targets(), run_targets(), server_targets()})
      joined.insert(joined.end(), some.begin(), some.end());
    return joined;
  }();
  return all;
}

size_t memory_allowed(const Target& target, const uint8_t* bytes, size_t size) {
  constexpr size_t mb = size_t{1} << 20;
  switch (target.holds(bytes, size)) {
    case Holds::anything:
      return std::numeric_limits<size_t>::max();
    case Holds::packed:
      return 64 * mb + 2 * (64 * mb + 100 * size);
    case Holds::its_size:
      break;
  }
  return 64 * mb + 2 * size;
}

namespace {

// The start of the seed, and behind its first bracket, comma or line end.
std::vector<size_t> places_of_any_length(const std::string& seed) {
  std::vector<size_t> found{0};
  if (const size_t at = seed.find_first_of("[,\n"); at != seed.npos) found.push_back(at + 1);
  return found;
}

}  // namespace

void for_long_files(const std::string& seeds, size_t size, const SeeLongFile& see) {
  for (const auto& entry : std::filesystem::directory_iterator(seeds)) {
    const std::string seed = contents(entry.path().string());
    for (const size_t at : places_of_any_length(seed))
      for (const std::string words : {"[],", "1 2 3\n", "\n", "a"}) {
        std::string input = seed.substr(0, at);
        input.reserve(size + seed.size() + words.size());
        while (input.size() < size) input += words;
        input += seed.substr(at);
        see(fmt::format("{}, '{}' from byte {}", entry.path().filename().string(), words, at),
            input);
      }
  }
}

}  // namespace gflow::fuzz
