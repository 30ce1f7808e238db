// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/file_pieces.hpp"

#include <filesystem>
#include <random>

#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {

// A MB of bytes, several pieces of a file.
std::string some_bytes() {
  std::string bytes(size_t{1} << 20, '\0');
  std::mt19937 random(1);
  for (char& c : bytes) c = char(random());
  return bytes;
}

}  // namespace

TEST(FilePieces, GivesTheBytesOfTheFileInWhateverSteps) {
  const TemporaryFolder folder;
  const std::string bytes = some_bytes();
  const std::string path = folder.write("a", bytes);
  std::mt19937 random(2);
  for (const size_t longest : {1u, 100u, 5000u, 300000u, 2000000u}) {
    FilePieces file(path);
    while (file.left() > 0) {
      const size_t most = random() % longest + 1;
      const size_t expected = std::min(most, bytes.size() - file.place());
      ASSERT_EQ(file.ahead(most), bytes.substr(file.place(), expected)) << file.place();
      file.step(random() % (expected + 1));  // less than was inspected
      if (longest == 1) file.step(std::min<size_t>(file.left(), random() % 50));
    }
    EXPECT_EQ(file.place(), bytes.size());
    EXPECT_TRUE(file.ahead(10).empty());
  }
}

TEST(FilePieces, StepsOverMoreThanItHolds) {
  const TemporaryFolder folder;
  const std::string bytes = some_bytes();
  FilePieces file(folder.write("a", bytes));
  file.ahead(7);
  file.step(3);
  file.step(700000);
  EXPECT_EQ(file.place(), 700003u);
  EXPECT_EQ(file.ahead(100), bytes.substr(700003, 100));
  file.step(file.left());
  EXPECT_EQ(file.left(), 0u);
}

TEST(FilePieces, GivesLinesOfAnyLengthUpToAMegabyte) {
  const TemporaryFolder folder;
  const std::string longest(1 << 20, 'x');
  const std::string path = folder.write("a", "one\r\n\n" + longest + "\n" + longest + "y\nend");
  FilePieces file(path);
  std::string line;
  for (const std::string& expected : {std::string("one"), std::string(), longest}) {
    ASSERT_TRUE(file.next_line(line));
    EXPECT_EQ(line, expected);
  }
  ASSERT_TRUE(file.skip_line());
  ASSERT_TRUE(file.next_line(line));
  EXPECT_EQ(line, "end");
  EXPECT_FALSE(file.next_line(line));
  EXPECT_FALSE(file.skip_line());

  FilePieces again(path);
  for (int i = 0; i < 3; ++i) again.skip_line();
  ASSERT_TRUE(again.next_line(line));
  EXPECT_EQ(line, longest);  // without the y
  ASSERT_TRUE(again.next_line(line));
  EXPECT_EQ(line, "end");
}

TEST(FilePieces, CountsLines) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a", "1\n2\n" + std::string(600000, ' ') + "\n4");
  EXPECT_EQ(line_of(path, 0), 1u);
  EXPECT_EQ(line_of(path, 2), 2u);
  EXPECT_EQ(line_of(path, 500000), 3u);
  EXPECT_EQ(line_of(path, 600005), 4u);
  EXPECT_EQ(line_of(folder.file("none"), 0), 0u);
}

TEST(FilePieces, EndsWhereTheFileWasCutMeanwhile) {
  const TemporaryFolder folder;
  const std::string bytes = some_bytes();
  const std::string path = folder.write("a", bytes);
  FilePieces file(path);
  file.step(300000);
  std::filesystem::resize_file(path, 400000);
  EXPECT_EQ(file.ahead(500000), bytes.substr(300000, 100000));
  EXPECT_EQ(file.left(), 100000u);
}

TEST(FilePieces, RefusesWhatIsNoFile) {
  const TemporaryFolder folder;
  expect_error([&] { FilePieces(folder.file("none")); }, {"cannot read", "none", "No such file"});
  expect_error([&] { FilePieces(folder.path()); }, {"cannot read", "not a file"});
}
