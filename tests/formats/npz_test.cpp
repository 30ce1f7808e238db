// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/npz.hpp"

#include <sys/inotify.h>
#include <sys/stat.h>

#include <cstdlib>

#include "runtime/files/atomic_file.hpp"
#include "runtime/files/descriptor.hpp"
#include "tests/fuzz/checksums.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

TEST(Npz, WhatIsWrittenIsReadAgain) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  const Arrays arrays = {{"means", {{2, 3}, std::vector<float>{1, 2, 3, 4, 5, 6}}},
                         {"n", {{}, std::vector<int64_t>{-7}}},
                         {"none", {{0}, std::vector<double>{}}}};
  write_npz(path, arrays);
  const Arrays back = read_npz(path);
  ASSERT_EQ(back.size(), 3u);
  for (const auto& [name, array] : arrays) {
    EXPECT_EQ(back.at(name).shape, array.shape) << name;
    EXPECT_EQ(back.at(name).values, array.values) << name;
  }
  EXPECT_EQ(folder.count(), 1u);
}

// A signal handler removes the temporary; other files would be left behind.
TEST(Npz, NoFileIsMadeButTheTemporary) {
  const TemporaryFolder folder;
  const Descriptor made(inotify_init1(IN_NONBLOCK | IN_CLOEXEC));
  ASSERT_GE(inotify_add_watch(made.get(), folder.path().c_str(), IN_CREATE), 0);
  write_npz(folder.file("a.npz"), {{"a", {{3}, std::vector<float>{1, 2, 3}}}});
  alignas(inotify_event) char events[4096];
  const ssize_t bytes = ::read(made.get(), events, sizeof events);
  ASSERT_GT(bytes, 0);
  size_t count = 0;
  for (ssize_t at = 0; at < bytes; ++count) {
    const auto* event = reinterpret_cast<const inotify_event*>(events + at);
    EXPECT_TRUE(is_temporary_name(event->name)) << event->name;
    at += ssize_t(sizeof *event + event->len);
  }
  EXPECT_EQ(count, 1u);
}

TEST(Npz, EqualArraysGiveEqualFiles) {
  const TemporaryFolder folder;
  const Arrays arrays = {{"a", {{3}, std::vector<float>{1, 2, 3}}}};
  write_npz(folder.file("a.npz"), arrays);
  write_npz(folder.file("b.npz"), arrays);
  EXPECT_EQ(contents(folder.file("a.npz")), contents(folder.file("b.npz")));
}

TEST(Npz, StoredArraysComeBackAndAreCheckedToo) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  const Arrays arrays = {{"abc", {{300}, std::vector<float>(300, 1.f)}}};
  write_npz(path, arrays, Packing::stored);
  std::string whole = contents(path);
  EXPECT_GT(whole.size(), 1200u);
  EXPECT_EQ(read_npz(path).at("abc").values, arrays.at("abc").values);
  whole[500] ^= 1;
  folder.write("bad.npz", whole);
  expect_error([&] { read_npz(folder.file("bad.npz")); }, {"'abc'", "bad.npz"});
}

TEST(Npz, ExactValuesHaveTheTypeAndShapeAskedFor) {
  const Arrays arrays = {{"a", {{2, 1}, std::vector<float>{1, 2}}}};
  EXPECT_EQ(exact_values<float>(arrays, "a", {2, 1}, "x.npz")[1], 2);
  expect_error(
      [&] {
        exact_values<float>(arrays, "a", {1, 2}, "x.npz");
      },
      {"x.npz", "'a'", "(2, 1)", "(1, 2)"});
  expect_error([&] { exact_values<double>(arrays, "a", {2, 1}, "x.npz"); }, {"number type"});
}

TEST(Npz, AMissingArrayIsNamedWithThoseThatAreThere) {
  const Arrays arrays = {{"a", {{}, std::vector<float>{1}}}, {"b", {{}, std::vector<float>{2}}}};
  EXPECT_EQ(array_named(arrays, "b", "x.npz").as_float()[0], 2);
  expect_error([&] { array_named(arrays, "c", "x.npz"); }, {"x.npz", "'c'", "a, b"});
}

TEST(Npz, MissingAndTruncatedArchivesAreRefused) {
  const TemporaryFolder folder;
  expect_error([&] { read_npz(folder.path() + "/none.npz"); }, {"none.npz"});
  const std::string path = folder.file("a.npz");
  write_npz(path, {{"a", {{300}, std::vector<int32_t>(300, 1)}}});
  const std::string whole = contents(path);
  folder.write("cut.npz", whole.substr(0, whole.size() / 2));
  expect_error([&] { read_npz(folder.file("cut.npz")); }, {"cut.npz", "truncated or damaged"});
  folder.write("text.npz", "means");
  expect_error([&] { read_npz(folder.file("text.npz")); }, {"text.npz", "is not an .npz file"});
  folder.write("empty.npz", "");
  expect_error([&] { read_npz(folder.file("empty.npz")); }, {"empty.npz", "is not an .npz file"});
  expect_error([&] { read_npz(folder.path()); }, {folder.path(), "is a folder"});
  ASSERT_EQ(::mkfifo(folder.file("pipe.npz").c_str(), 0600), 0);
  expect_error([&] { read_npz(folder.file("pipe.npz")); }, {"pipe.npz", "is not a file"});
}

TEST(Npz, AnArrayIsThereOnce) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  write_npz(path, {{"a", {{}, std::vector<float>{1}}}, {"b", {{}, std::vector<float>{2}}}});
  std::string whole = contents(path);
  for (size_t at; (at = whole.find("b.npy")) != whole.npos;) whole[at] = 'a';
  folder.write("twice.npz", whole);
  expect_error([&] { read_npz(folder.file("twice.npz")); }, {"twice.npz", "'a' twice"});
}

TEST(Npz, DamagedContentsAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  std::vector<int32_t> values(300);
  for (int i = 0; i < 300; ++i) values[size_t(i)] = i * i;
  write_npz(path, {{"abc", {{300}, values}}});
  std::string whole = contents(path);
  whole[100] ^= 0x55;  // within the compressed values
  folder.write("bad.npz", whole);
  expect_error([&] { read_npz(folder.file("bad.npz")); }, {"'abc'", "bad.npz"});
}

// The fuzzer relies on this: with corrected checksums, damaged values are read.
TEST(Npz, DamageIsReadWhenTheChecksumsAreThoseOfIt) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.npz");
  // Large values, because the bytes of small ones also occur in the headers of the archive.
  const int32_t first = 80000008, second = 90000009;
  const Arrays arrays = {{"a", {{2}, std::vector<int32_t>{7, first}}},
                         {"b", {{1}, std::vector<int32_t>{second}}}};
  write_npz(path, arrays, Packing::stored);
  std::string bytes = contents(path);
  for (const int32_t value : {first, second}) {
    const size_t at = bytes.find(std::string(reinterpret_cast<const char*>(&value), sizeof value));
    ASSERT_NE(at, std::string::npos);
    bytes[at] = char(bytes[at] + 10);
  }
  expect_error([&] { read_npz(folder.write("bad.npz", bytes)); }, {"bad.npz"});
  const std::string mended =
      fuzz::with_checksums(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  const Arrays back = read_npz(folder.write("mended.npz", mended));
  EXPECT_EQ(std::get<std::vector<int32_t>>(back.at("a").values),
            (std::vector<int32_t>{7, first + 10}));
  EXPECT_EQ(std::get<std::vector<int32_t>>(back.at("b").values),
            (std::vector<int32_t>{second + 10}));
}

TEST(Npz, AnUnwritablePlaceIsAnError) {
  expect_error(
      [] {
        write_npz("/no/such/a.npz", {{"a", {{}, std::vector<float>{1}}}});
      },
      {"/no/such/a.npz"});
  expect_error([] { write_npz("a.npz", {}); }, {"no arrays"});
}
