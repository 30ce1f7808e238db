// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/atomic_file.hpp"

#include <sys/stat.h>

#include "optim/formats/npy.hpp"
#include "optim/formats/splat_table.hpp"
#include "tests/support/file_size_limit.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

// The temporary name beside it must not exceed the maximum length.
TEST(AtomicFile, ANameAsLongAsNamesMayBeIsWritten) {
  const TemporaryFolder folder;
  const std::string name = folder.path() + "/" + std::string(251, 'q') + ".ply";
  write_file_atomically(name, std::string_view("abc"));
  EXPECT_EQ(contents(name), "abc");
  EXPECT_EQ(folder.count(), 1u);
}

TEST(AtomicFile, WritesAndReplaces) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.txt");
  write_file_atomically(path, std::string_view("first"));
  write_file_atomically(path, std::string_view("second"));
  EXPECT_EQ(contents(path), "second");
  EXPECT_EQ(folder.count(), 1u);
}

TEST(AtomicFile, APrivateFileStaysPrivate) {
  const TemporaryFolder folder;
  const std::string path = folder.write("file", "old");
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  write_file_atomically(path, "new");
  struct stat info;
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0600u);
  EXPECT_EQ(contents(path), "new");
}

TEST(AtomicFile, AFailedWriterLeavesTheOldFileAndNoTemporary) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.txt", "old");
  EXPECT_THROW(replace_file(path,
                            [](const std::string& temporary) {
                              std::ofstream(temporary) << "half";
                              throw Error("no more");
                            }),
               Error);
  EXPECT_EQ(contents(path), "old");
  EXPECT_EQ(folder.count(), 1u);
}

TEST(AtomicFile, AFullDiskIsAnErrorThatLeavesTheOldFile) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.txt", "old");
  // A file size limit acts like a full disk: write() fails after a partial write.
  {
    const FileSizeLimit limit(1000);
    expect_error([&] { write_file_atomically(path, Bytes(5000)); },
                 {"cannot write " + path, "File too large"});
  }
  EXPECT_EQ(contents(path), "old");
  EXPECT_EQ(folder.count(), 1u);
}

TEST(AtomicFile, AFullDiskIsToldFromOtherFaults) {
  EXPECT_THROW(throw_write_error("a", ENOSPC), DiskFull);
  EXPECT_THROW(throw_write_error("a", EDQUOT), DiskFull);
  try {
    throw_write_error("a", EIO);
  } catch (const DiskFull&) {
    ADD_FAILURE() << "no room would help";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()), "cannot write a: Input/output error");
  }
}

TEST(AtomicFile, PiecesAreOneFileOrNone) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.txt", "old");
  const std::string piece(300000, 'x');
  const auto write_ten = [&](const Append& write) {
    for (int i = 0; i < 10; ++i) write(piece);
  };
  {
    const FileSizeLimit limit(2000000);  // a first part is written
    expect_error([&] { write_file_in_pieces(path, write_ten); },
                 {"cannot write " + path, "File too large"});
  }
  EXPECT_EQ(contents(path), "old");
  EXPECT_EQ(folder.count(), 1u);
  write_file_in_pieces(path, write_ten);
  EXPECT_EQ(contents(path), std::string(3000000, 'x'));
  write_file_in_pieces(path, [](const Append&) {});
  EXPECT_EQ(contents(path), "");
  EXPECT_EQ(folder.count(), 1u);
}

TEST(AtomicFile, AMissingFolderIsNamed) {
  expect_error([] { write_file_atomically("/no/such/folder/x", std::string_view("a")); },
               {"/no/such/folder/x", "No such file or directory"});
}

TEST(AtomicFile, MissingFilesFoldersAndLongFilesAreRefused) {
  const TemporaryFolder folder;
  expect_error([&] { read_file(folder.path() + "/none"); }, {"none", "No such file"});
  expect_error([&] { read_file(folder.path()); }, {"not a file"});
  const std::string path = folder.write("long", std::string(100, 'x'));
  expect_error([&] { read_file(path, 99); }, {"100 bytes", "limit of 99 bytes"});
}

// Opening a pipe without a writer would block forever.
TEST(AtomicFile, WhatIsNoFileIsNotOpened) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo(folder.file("pipe").c_str(), 0600), 0);
  for (const std::string& path : {folder.file("pipe"), folder.path(), std::string("/dev/zero")}) {
    expect_error([&] { read_file(path); }, {path, "it is not a file"});
    expect_error([&] { read_splats(path); }, {path, "it is not a file"});
  }
  expect_error([&] { require_file(folder.file("none")); }, {"none", "No such file"});
}

TEST(AtomicFile, GzipIsExpandedByContent) {
  const TemporaryFolder folder;
  std::string text;
  for (unsigned i = 0; i < 500000; ++i) text += char('a' + i * i % 26);
  const std::string path = folder.file("plain.name");
  write_file_atomically(path, gzip(text));
  const auto whole = [&](const Bytes&) { return text.size(); };
  const Bytes back = read_file_or_gzip(path, whole);
  EXPECT_TRUE(std::equal(text.begin(), text.end(), back.begin(), back.end()));
  expect_error([&] { read_file_or_gzip(path, [](const Bytes&) { return size_t(499999); }); },
               {"data continues after the 499999 bytes"});
}

// A few kB that expand to much more than their header announces.
TEST(AtomicFile, GzipIsExpandedNoFurtherThanItsHeaderAnnounces) {
  const TemporaryFolder folder;
  const Bytes four = npy_bytes({{1}, std::vector<float>{1}});
  const std::string bomb = std::string(four.begin(), four.end()) + std::string(1 << 25, '\0');
  write_file_atomically(folder.file("a.npy"), gzip(bomb));
  expect_error([&] { read_npy(folder.file("a.npy")); },
               {"a.npy", fmt::format("data continues after the {} bytes", four.size())});
}

TEST(AtomicFile, TruncatedAndDamagedGzipIsRefused) {
  const TemporaryFolder folder;
  const auto any_length = [](const Bytes&) { return largest_file; };
  const Bytes packed = gzip("a text that is packed, a text that is packed");
  const std::string text(packed.begin(), packed.end());
  const std::string cut = folder.write("cut.gz", text.substr(0, text.size() - 9));
  expect_error([&] { read_file_or_gzip(cut, any_length); }, {"cut.gz", "truncated"});
  std::string damaged = text;
  damaged[text.size() - 6] ^= 1;  // in the checksum
  folder.write("bad.gz", damaged);
  expect_error([&] { read_file_or_gzip(folder.file("bad.gz"), any_length); },
               {"bad.gz", "damaged"});
}

TEST(RequireFreeSpace, RefusesWhatNoDiskHolds) {
  const TemporaryFolder folder;
  EXPECT_NO_THROW(require_free_space(folder.path(), 1, "a byte", "nothing"));
  expect_error(
      [&] {
        require_free_space(folder.path(), uint64_t{1} << 62, "optical flow", "train without it");
      },
      {"optical flow would need 4611686018.4 GB", folder.path(), "train without it"});
  EXPECT_NO_THROW(require_free_space(folder.file("missing"), 1, "a byte", "nothing"));
}
