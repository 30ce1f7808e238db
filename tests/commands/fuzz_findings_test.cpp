// SPDX-License-Identifier: Apache-2.0
// Past findings of tests/fuzz/run in tests/data/fuzz/TARGET are read or rejected; so is each seed,
// complete and truncated.
#include <fmt/format.h>

#include "tests/fuzz/targets.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

void read(const fuzz::Target& target, const std::string& bytes) {
  target.read(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
}

TEST(FuzzFindings, StayMended) {
  size_t findings = 0;
  for (const fuzz::Target& target : fuzz::targets()) {
    const fs::path folder = fs::path(GFLOW_SOURCE_DIR) / "tests" / "data" / "fuzz" / target.name;
    if (!fs::exists(folder)) continue;
    for (const auto& entry : fs::directory_iterator(folder)) {
      SCOPED_TRACE(entry.path().string());
      EXPECT_NO_THROW(read(target, contents(entry.path().string())));
      ++findings;
    }
  }
  EXPECT_GE(findings, 1u);
}

TEST(FuzzFindings, SeedsAreReadAtEveryQuarter) {
  for (const fuzz::Target& target : fuzz::targets()) {
    const TemporaryFolder folder;
    target.make_seeds(folder.path());
    EXPECT_FALSE(fs::is_empty(folder.path())) << target.name;
    for (const auto& entry : fs::directory_iterator(folder.path())) {
      SCOPED_TRACE(fmt::format("{} {}", target.name, entry.path().filename().string()));
      const std::string whole = contents(entry.path().string());
      for (size_t quarter = 0; quarter <= 4; ++quarter)
        EXPECT_NO_THROW(read(target, whole.substr(0, whole.size() * quarter / 4)));
    }
  }
}

bool waits_for_a_process(const fuzz::Target& target) {
  return target.name == std::string("guidance");
}

// Files of 1 MB. `tests/fuzz/run` uses larger ones, for which the fixed 64 MB matter less.
TEST(FuzzFindings, LongFilesTakeTheMemoryTheyMay) {
  constexpr size_t size = 1 << 20;
  double most = 0;
  for (const fuzz::Target& target : fuzz::targets()) {
    if (waits_for_a_process(target)) continue;
    const TemporaryFolder folder;
    target.make_seeds(folder.path());
    target.read(nullptr, 0);  // allocates what is made once, which does not count
    fuzz::for_long_files(
        folder.path(), size, [&](const std::string& what, const std::string& input) {
          const auto* bytes = reinterpret_cast<const uint8_t*>(input.data());
          const double mib = memory_of([&] { target.read(bytes, input.size()); });
          EXPECT_LE(mib, double(fuzz::memory_allowed(target, bytes, input.size())) / (1 << 20))
              << target.name << ", " << what;
          most = std::max(most, mib);
        });
  }
  if (most == 0) GTEST_SKIP() << "memory cannot be measured here";
}

}  // namespace
}  // namespace gflow
