// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/npy.hpp"

#include <cmath>
#include <cstring>

#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {

// A .npy file built by the published format, version 1.0.
std::string npy(const std::string& dictionary, const std::string& values, char version = 1) {
  std::string bytes = "\x93NUMPY";
  bytes += version;
  bytes += '\0';
  bytes += char(dictionary.size() & 255);
  bytes += char(dictionary.size() >> 8);
  if (version > 1) bytes += std::string(2, '\0');
  return bytes + dictionary + values;
}

std::string dictionary(const std::string& descr, const std::string& shape,
                       const std::string& order = "False") {
  return "{'descr': '" + descr + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
}

Array parse(const std::string& bytes) {
  return parse_npy(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), "x.npy");
}

}  // namespace

TEST(Npy, ReadsLittleEndianIntegers) {
  const std::string values("\x01\x00\x00\x00\xfe\xff\xff\xff", 8);
  const Array array = parse(npy(dictionary("<i4", "(2,)"), values));
  EXPECT_EQ(array.shape, (std::vector<size_t>{2}));
  EXPECT_EQ(array.as_int(), (std::vector<int32_t>{1, -2}));
}

TEST(Npy, ReadsVersionTwoScalarsAndBooleans) {
  const std::string half("\x00\x00\x00\x00\x00\x00\xe0\x3f", 8);  // 0.5
  const Array scalar = parse(npy(dictionary("<f8", "()"), half, 2));
  EXPECT_TRUE(scalar.shape.empty());
  EXPECT_EQ(scalar.as_float(), std::vector<float>{0.5f});
  EXPECT_EQ(parse(npy(dictionary("|b1", "(1, 2)"), std::string("\x01\x00", 2))).as_int(),
            (std::vector<int32_t>{1, 0}));
}

// What networks write.
TEST(Npy, ReadsHalfFloatsAndFortranOrder) {
  // 1, -2, 0.333, 65504, inf, the smallest half
  const std::string halves("\x00\x3c\x00\xc0\x55\x35\xff\x7b\x00\x7c\x01\x00", 12);
  const std::vector<float> values = parse(npy(dictionary("<f2", "(6,)"), halves)).as_float();
  EXPECT_EQ(values, (std::vector<float>{1, -2, 0.333251953125f, 65504, INFINITY, 0x1p-24f}));
  const std::string six("\1\2\3\4\5\6", 6);  // rows 1 3 5 and 2 4 6
  const Array array = parse(npy(dictionary("|u1", "(2, 3)", "True"), six));
  EXPECT_EQ(array.shape, (std::vector<size_t>{2, 3}));
  EXPECT_EQ(array.as_int(), (std::vector<int32_t>{1, 3, 5, 2, 4, 6}));
}

TEST(Npy, ReadsAnEmptyArray) {
  const Array array = parse(npy(dictionary("<f4", "(0, 3)"), ""));
  EXPECT_EQ(array.size(), 0u);
  EXPECT_EQ(array.shape_text(), "(0, 3)");
}

TEST(Npy, WhatIsWrittenIsReadAgain) {
  const TemporaryFolder folder;
  const Array array{{2, 3}, std::vector<uint16_t>{1, 2, 3, 4, 5, 65535}};
  const std::string path = folder.file("a.npy");
  write_npy(path, array);
  const Array back = read_npy(path);
  EXPECT_EQ(back.shape, array.shape);
  EXPECT_EQ(back.values, array.values);
  // The format requires values at a multiple of 64 bytes.
  EXPECT_EQ((contents(path).size() - 12) % 64, 0u);
}

TEST(Npy, AnArrayWithoutItsValuesIsNotWritten) {
  expect_error([] { npy_bytes({{2, 2}, std::vector<float>(3)}); }, {"(2, 2)", "3 values"});
}

TEST(Npy, RefusesWhatItDoesNotRead) {
  const std::string four(4, '\0');
  expect_error([&] { parse(npy(dictionary(">f4", "(1,)"), four)); }, {">f4", "little-endian"});
  expect_error([&] { parse(npy(dictionary("<c8", "(1,)"), four)); }, {"<c8"});
  expect_error([&] { parse(npy("{'descr': [('a', '<f4')]}", four)); }, {"records"});
  expect_error([&] { parse(npy("", four)); }, {"x.npy", "no 'descr'"});
  expect_error([&] { parse(npy(dictionary("<f4", "(1,)"), four, 9)); }, {"version 9"});
  expect_error([&] { parse("no array at all"); }, {"x.npy", ".npy file"});
}

// A regular expression overflowed the stack on such headers.
TEST(Npy, BlanksAndLettersOfAnyNumberAreNoObstacle) {
  const std::string four(4, '\0'), blanks(60000, ' ');
  const std::string order = ", 'fortran_order': False, 'shape': (1,)}";
  EXPECT_EQ(parse(npy("{'descr'" + blanks + ": '<f4'" + order, four)).size(), 1u);
  EXPECT_EQ(parse(npy("{'descr': " + blanks + "'<f4'" + order, four)).size(), 1u);
  expect_error([&] { parse(npy("{'descr'" + blanks, four)); }, {"records"});
  expect_error([&] { parse(npy("{'descr': '" + std::string(60000, 'f') + "'" + order, four)); },
               {"records"});
  for (const std::string& shape :
       std::vector<std::string>{"(1", "1,)", "(1, x)", "(" + blanks + ")"})
    expect_error([&] { parse(npy(dictionary("<f4", shape), four)); },
                 {"'fortran_order' and 'shape'"});
  for (const char* other : {"Truly", "0", ""})
    expect_error([&] { parse(npy(dictionary("<f4", "(1,)", other), four)); },
                 {"'fortran_order' and 'shape'"});
}

TEST(Npy, RefusesALengthThatIsNotTheShapes) {
  const std::string four(4, '\0');
  expect_error([&] { parse(npy(dictionary("<f4", "(2,)"), four)); }, {"4 bytes", "needs 8"});
  expect_error([&] { parse(npy(dictionary("<f4", "()"), four + four)); }, {"8 bytes", "needs 4"});
  expect_error([&] { parse(npy(dictionary("<f8", "(99999999999, 99999999999)"), four)); },
               {"too large"});
  const std::string whole = npy(dictionary("<f4", "(1,)"), four);
  for (size_t n = 0; n < whole.size(); ++n)
    EXPECT_THROW(parse(whole.substr(0, n)), Error) << n << " bytes";
}
