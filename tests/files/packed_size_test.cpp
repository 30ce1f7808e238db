// SPDX-License-Identifier: Apache-2.0
// Short files that claim gigabytes are rejected before memory is allocated for them.
#include "runtime/files/packed_size.hpp"

#include <cstring>

#include "optim/formats/flo.hpp"
#include "optim/formats/npz.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

TEST(PackedSize, AHundredTimesTheFileAnd64MBArePlausible) {
  const size_t mb = size_t{1} << 20;
  EXPECT_NO_THROW(require_plausible_size(64 * mb, 0, "a"));
  EXPECT_NO_THROW(require_plausible_size(64 * mb + 99, 1, "a"));
  expect_error([&] { require_plausible_size(64 * mb + 100, 1, "a.gz"); },
               {"a.gz", "1 bytes", "64 MB", "67108964 times"});
  EXPECT_NO_THROW(require_plausible_size(1000 * mb, 10 * mb, "a"));
  EXPECT_THROW(require_plausible_size(1064 * mb, 10 * mb, "a"), Error);
  EXPECT_NO_THROW(require_plausible_size(256 * mb, 0, "a", 256 * mb));
  EXPECT_THROW(require_plausible_size(~size_t{0}, 10 * mb, "a"), Error);
}

TEST(PackedSize, AFlowOfASizeThatNoImageHas) {
  const TemporaryFolder folder;
  const int32_t side = 30000;
  std::string flow("PIEH");
  for (int k = 0; k < 2; ++k) flow.append(reinterpret_cast<const char*>(&side), 4);
  write_file_atomically(folder.file("a.flo.gz"), gzip(flow + std::string(3 << 20, '\0')));
  expect_error([&] { read_flo(folder.file("a.flo.gz")); }, {"a.flo.gz", "decompress to 6866 MB"});
  // Without motion: compresses a thousandfold.
  write_flo(folder.file("still.flo.gz"), zero_flow(1920, 1080));
  EXPECT_EQ(read_flo(folder.file("still.flo.gz")).uv.size(), 2u * 1920 * 1080);
}

TEST(PackedSize, ArraysOfZerosTogether) {
  const TemporaryFolder folder;
  const Array zeros{{size_t{30} << 20}, std::vector<uint8_t>(size_t{30} << 20)};
  write_npz(folder.file("a.npz"), {{"a", zeros}, {"b", zeros}, {"c", zeros}});
  expect_error([&] { read_npz(folder.file("a.npz")); }, {"a.npz", "decompress to 90 MB"});
  EXPECT_EQ(read_npz(folder.file("a.npz"), {"a", "c"}).at("c").size(), zeros.size());
  // A caller that knows the contents, such as a model's tables by its PLY, states the limit.
  EXPECT_EQ(read_npz(folder.file("a.npz"), {}, 100u << 20).size(), 3u);
}
