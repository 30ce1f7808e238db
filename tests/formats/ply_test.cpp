// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/ply.hpp"

#include <cstring>

#include "tests/support/memory_of.hpp"
#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {

template <class T>
std::string raw(T value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

const char* const ascii_cloud =
    "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 2\nproperty float x\n"
    "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
    "property uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 1 2 255 0 9\n-1.5 2e1 3 1 2 3\n3 0 1 0\n";

}  // namespace

TEST(Ply, ReadsAnAsciiCloud) {
  const TemporaryFolder folder;
  const PointCloud points = read_point_cloud(folder.write("a.ply", ascii_cloud));
  EXPECT_EQ(points.xyz, (std::vector<double>{0, 1, 2, -1.5f, 20, 3}));
  EXPECT_EQ(points.rgb, (std::vector<uint8_t>{255, 0, 9, 1, 2, 3}));
}

TEST(Ply, ReadsBinaryWithElementsBeforeAndPropertiesBetween) {
  const TemporaryFolder folder;
  std::string bytes =
      "ply\r\nformat binary_little_endian 1.0\r\nelement chunk 1\r\n"
      "property list uchar short ids\r\nelement vertex 2\r\nproperty double x\r\n"
      "property float y\r\nproperty ushort label\r\nproperty float z\r\nend_header\r\n";
  bytes += raw(uint8_t(2)) + raw(int16_t(5)) + raw(int16_t(6));
  for (int i = 0; i < 2; ++i)
    bytes += raw(1.0 + i) + raw(2.f + float(i)) + raw(uint16_t(60000)) + raw(3.f + float(i));
  const std::string path = folder.write("a.ply", bytes);
  EXPECT_EQ(read_point_cloud(path).xyz, (std::vector<double>{1, 2, 3, 2, 3, 4}));
  EXPECT_TRUE(read_point_cloud(path).rgb.empty());
  EXPECT_EQ(read_ply(path).column_values("label"), (std::vector<float>{60000, 60000}));
}

TEST(Ply, ReadsBigEndian) {
  const TemporaryFolder folder;
  const auto bytes = [](bool big) {
    const auto number = [big](auto value) {
      std::string bytes = raw(value);
      if (big) std::reverse(bytes.begin(), bytes.end());
      return bytes;
    };
    std::string file = fmt::format("ply\nformat binary_{}_endian 1.0\n", big ? "big" : "little");
    file += "element face 1\nproperty list ushort int vertex_indices\nelement vertex 2\n";
    for (const char* type : {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"})
      file += fmt::format("property {0} as_{0}\n", type);
    file += "property float x\nproperty float y\nproperty float z\nend_header\n";
    file += number(uint16_t(2)) + number(int32_t(7)) + number(int32_t(8));
    for (int i = 0; i < 2; ++i) {
      file += number(int8_t(-3 - i)) + number(uint8_t(200 + i)) + number(int16_t(-300 - i)) +
              number(uint16_t(60000 + i)) + number(int32_t(-70000 - i)) +
              number(uint32_t(1u << 31)) + number(-1.25f) + number(0.375);
      for (const float place : {1.f, -2.5f, 3e7f}) file += number(place);
    }
    return file;
  };
  const std::string big = folder.write("big.ply", bytes(true));
  const std::string little = folder.write("little.ply", bytes(false));
  const PlyTable table = read_ply(big);
  EXPECT_EQ(table.values, read_ply(little).values);
  EXPECT_EQ(table.column_values("as_short"), (std::vector<float>{-300, -301}));
  EXPECT_EQ(table.column_values("as_float"), (std::vector<float>{-1.25f, -1.25f}));
  EXPECT_EQ(table.column_values("as_double"), (std::vector<float>{0.375f, 0.375f}));
  EXPECT_EQ(read_point_cloud(big).xyz, (std::vector<double>{1, -2.5, 3e7, 1, -2.5, 3e7}));
}

TEST(Ply, FloatColorsAreScaled) {
  const TemporaryFolder folder;
  const PointCloud points = read_point_cloud(folder.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty float red\nproperty float green\nproperty float blue\n"
      "end_header\n0 0 0 0 1 0.5"));
  EXPECT_EQ(points.rgb, (std::vector<uint8_t>{0, 255, 128}));
}

// Float colours of 0 to 255, as some programs write them, were read as white.
TEST(Ply, FloatColorsMayGoTo255) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& rows) {
    return read_point_cloud(
               folder.write("a.ply",
                            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n"
                            "property float y\nproperty float z\nproperty float red\n"
                            "property float green\nproperty double blue\nend_header\n" +
                                rows))
        .rgb;
  };
  EXPECT_EQ(read("0 0 0 0 1 0.6\n0 0 0 12.4 255 300\n"),
            (std::vector<uint8_t>{0, 1, 1, 12, 255, 255}));
  EXPECT_EQ(read("0 0 0 0 1 0.5\n0 0 0 nan 0 -1\n"), (std::vector<uint8_t>{0, 255, 128, 0, 0, 0}));
  // 1.001 is a rounding error; Inf does not tell the range.
  EXPECT_EQ(read("0 0 0 0 1.001 0.5\n0 0 0 inf 0 1\n"),
            (std::vector<uint8_t>{0, 255, 128, 0, 0, 255}));
}

TEST(Ply, ColorsHaveTheNamesThatProgramsUse) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& red, const std::string& green, const std::string& blue) {
    return read_point_cloud(
               folder.write(
                   "a.ply",
                   fmt::format("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                               "property float y\nproperty float z\nproperty uchar {}\n"
                               "property uchar {}\nproperty uchar {}\nend_header\n0 0 0 9 1 255\n",
                               red, green, blue)))
        .rgb;
  };
  const std::vector<uint8_t> color{9, 1, 255};
  EXPECT_EQ(read("red", "green", "blue"), color);
  EXPECT_EQ(read("diffuse_red", "diffuse_green", "diffuse_blue"), color);
  EXPECT_EQ(read("r", "g", "b"), color);
  EXPECT_TRUE(read("red", "green", "b").empty());
}

// colour = 1/2 + 0.28209479 f_dc, clamped to [0, 1]. Colours beside the harmonics are preferred.
TEST(Ply, TrainedGaussiansAreACloudInTheColoursOfTheirHarmonics) {
  const TemporaryFolder folder;
  const std::string start =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n";
  const PointCloud points =
      read_point_cloud(folder.write("a.ply", start + "end_header\n1 2 3 0.5 -9 0\n"));
  EXPECT_EQ(points.rgb, (std::vector<uint8_t>{163, 0, 128}));  // 255 (1/2 + 0.1410)
  const std::string both = start +
                           "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                           "end_header\n1 2 3 0.5 -9 0 7 8 9\n";
  EXPECT_EQ(read_point_cloud(folder.write("b.ply", both)).rgb, (std::vector<uint8_t>{7, 8, 9}));
}

TEST(Ply, ATableIsReadAgainAsWritten) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.ply");
  const PlyTable table{{"x", "opacity", "t_scale"}, 2, {1, 2, 3, 4, 5, -6.5f}, {"by gflow 1"}};
  write_ply(path, table);
  const PlyTable back = read_ply(path);
  EXPECT_EQ(back.names, table.names);
  EXPECT_EQ(back.rows, 2u);
  EXPECT_EQ(back.values, table.values);
  EXPECT_EQ(back.comments, table.comments);
  EXPECT_EQ(back.column("opacity"), 1);
  EXPECT_EQ(back.column("absent"), -1);
  EXPECT_EQ(back.column_values("t_scale"), (std::vector<float>{3, -6.5f}));
  expect_error([&] { back.column_values("absent"); }, {"'absent'"});
}

TEST(Ply, APointCloudIsReadAgainAsWritten) {
  const TemporaryFolder folder;
  const PointCloud points{{1, 2, 3, 4, 5, 6}, {10, 20, 30, 40, 50, 60}};
  write_point_cloud(folder.file("a.ply"), points);
  const PointCloud back = read_point_cloud(folder.file("a.ply"));
  EXPECT_EQ(back.xyz, points.xyz);
  EXPECT_EQ(back.rgb, points.rgb);
}

TEST(Ply, RefusesTruncatedFiles) {
  const TemporaryFolder folder;
  write_point_cloud(folder.file("a.ply"), {{1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}});
  const std::string whole = contents(folder.file("a.ply"));
  for (size_t n = 0; n < whole.size(); ++n) {
    const std::string path = folder.write("cut.ply", whole.substr(0, n));
    EXPECT_THROW(read_ply(path), Error) << n << " bytes";
  }
  const std::string text = ascii_cloud;
  folder.write("text.ply", text.substr(0, text.find("2e1")));  // inside the second vertex
  expect_error([&] { read_ply(folder.file("text.ply")); }, {"text.ply", "truncated"});
}

TEST(Ply, RefusesWhatGoesOnBehindItsLastRow) {
  const TemporaryFolder folder;
  write_point_cloud(folder.file("a.ply"), {{1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}});
  std::string bytes = contents(folder.file("a.ply"));
  bytes.replace(bytes.find("vertex 2"), 8, "vertex 1");
  const std::string path = folder.write("fewer.ply", bytes);
  expect_error([&] { read_ply(path); }, {"fewer.ply", "15 bytes follow its last row"});
  expect_error([&] { read_point_cloud(path); }, {"fewer.ply", "15 bytes follow its last row"});
  expect_error([&] { read_ply_elements(path); }, {"fewer.ply", "15 bytes follow its last row"});
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n1 2 3\n";
  folder.write("longer.ply", text + "\n4 5 6\n");
  expect_error([&] { read_point_cloud(folder.file("longer.ply")); },
               {"longer.ply", "6 bytes follow its last row"});

  // Trailing blanks of an editor and unknown elements are ignored.
  EXPECT_EQ(read_point_cloud(folder.write("blank.ply", text + "\n \r\n\n")).size(), 1u);
  std::string mesh = contents(folder.file("a.ply"));
  mesh.insert(mesh.find("end_header"), "element face 1\nproperty list uchar int vertex_indices\n");
  folder.write("mesh.ply", mesh + std::string("\1\0\0\0\0", 5));
  EXPECT_EQ(read_point_cloud(folder.file("mesh.ply")).size(), 2u);
}

TEST(Ply, RefusesCountsThatCannotBeInTheFile) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& format, const std::string& count) {
    return folder.write("a.ply", "ply\nformat " + format + " 1.0\nelement vertex " + count +
                                     "\nproperty float x\nend_header\n1 2 3\n");
  };
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"})
    for (const char* count : {"4000000000", "9000000000000000000"})
      expect_error([&] { read_ply(with(format, count)); }, {"a.ply", "truncated"});
  for (const char* rows : {"-1", "0x10", "1.5", "1 9", "1e3"})
    expect_error([&] { read_ply(with("ascii", rows)); }, {"no valid number of rows"});
  expect_error([&] { read_ply(with("binary_pdp_endian", "1")); },
               {"binary_pdp_endian", "binary_big_endian"});
  expect_error([&] { read_ply(with("ascii 1.0\nformat binary_little_endian", "1")); },
               {"two lines 'format'"});
}

TEST(Ply, RefusesHeadersThatMakeNoSense) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& text) { read_point_cloud(folder.write("a.ply", text)); };
  const std::string start = "ply\nformat ascii 1.0\n";
  for (const char* other : {"plx", "plyx\n", "", "pl"})
    expect_error([&] { read(other); }, {"a.ply", "a line 'ply'"});
  for (const char* begun : {"ply", "ply \t\r\n"})
    expect_error([&] { read(begun); }, {"end_header"});
  expect_error([&] { read(start + "element vertex 1\nproperty float x\n"); }, {"end_header"});
  expect_error([&] { read(start + "end_header\n"); }, {"no element 'vertex'"});
  expect_error([&] { read(start + "property float x\nend_header\n"); }, {"before any element"});
  expect_error([&] { read("ply\nformat ascii 2.0\n"); }, {"'format ascii 2.0'", "1.0"});
  expect_error([&] { read(start + "element vertex 1\nelement vertex 2\nend_header\n"); },
               {"element 'vertex' twice"});
  expect_error([&] { read(start + "element vertex 0\nproperty half x\nend_header\n"); },
               {"'half'"});
  expect_error([&] { read(start + "element vertex 9\nend_header\n"); }, {"no properties"});
  expect_error(
      [&] { read(start + "element vertex 1\nproperty list uchar int x\nend_header\n1 1\n"); },
      {"is a list"});
  expect_error(
      [&] {
        read(start +
             "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
             "end_header\n1 abc 2\n");
      },
      {"'abc' in line 8 is not a number"});
  expect_error(
      [&] { read(start + "element vertex 0\nproperty float x\nproperty int x\nend_header\n"); },
      {"'vertex'", "'x' twice"});
  expect_error([&] { read(start + "element vertex 1\nproperty float x\nend_header\n1\n"); },
               {"x, y and z"});
}

TEST(Ply, TakesDamagedTextForNoOtherNumbers) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& rows) {
    return read_ply(folder.write("a.ply",
                                 "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\n"
                                 "property float y\nend_header\n" +
                                     rows))
        .values;
  };
  const std::vector<float> four{1, 2, 3, 4};
  EXPECT_EQ(read("1 2\n3 4\n"), four);
  EXPECT_EQ(read("1 2 \r\n\n\n3\t+4"), four);
  expect_error([&] { read("1-2\n3 4\n"); }, {"a.ply", "'1-2' in line 7 is not a number"});
  expect_error([&] { read("1 2\n3 1.2.3\n"); }, {"'1.2.3' in line 8"});
  expect_error([&] { read("0x10 2\n3 4\n"); }, {"'0x10' in line 7"});
  expect_error([&] { read(std::string("1 2\n3\0004\n", 8)); },
               {"'3\\04' in line 8 is not a number"});
  expect_error([&] { read("1 2 3\n4 5\n"); }, {"line 7 has more values"});
  expect_error([&] { read("1\n2 3\n4 5\n"); }, {"line 7 has fewer values"});
  expect_error([&] { read("1 2\n3 1e400\n"); },
               {"'1e400' in line 8 is outside of the range of doubles"});
  expect_error([&] { read("1 2\n3 +-4\n"); }, {"'+-4' in line 8 is not a number"});
}

TEST(Ply, PointsWithoutAPlaceAreLeftOutAndColorsMayHave16Bits) {
  const TemporaryFolder folder;
  const std::string path = folder.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
      "float z\nproperty ushort red\nproperty ushort green\nproperty ushort blue\nend_header\n"
      "1 2 3 51400 25700 65535\n1 inf 3 0 0 0\n4 5 6 0 0 0\n");
  testing::internal::CaptureStderr();
  const PointCloud points = read_point_cloud(path);
  EXPECT_NE(testing::internal::GetCapturedStderr().find("1 of the 3 points in " + path),
            std::string::npos);
  EXPECT_EQ(points.xyz, (std::vector<double>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(points.rgb, (std::vector<uint8_t>{200, 100, 255, 0, 0, 0}));
  EXPECT_EQ(points.source, path);
}

TEST(Ply, RefusesPositionsThatAreNotFinite) {
  const TemporaryFolder folder;
  expect_error(
      [&] {
        read_point_cloud(folder.write("a.ply",
                                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                                      "property float y\nproperty float z\nend_header\n0 nan 1\n"));
      },
      {"1 of the 1 points", "NaN, infinite"});
  expect_error(
      [&] {
        read_point_cloud(
            folder.write("far.ply",
                         "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                         "property float y\nproperty float z\nend_header\n0 1e19 1\n"));
      },
      {"1 of the 1 points", "beyond 1e+18"});
}

TEST(Ply, RowsMayLieAcrossThePiecesOfAFile) {
  const TemporaryFolder folder;
  const std::string header =
      "element vertex 60000\nproperty float x\nproperty double y\nproperty uchar z\nend_header\n";
  std::string text = "ply\nformat ascii 1.0\n" + header;
  std::string binary = "ply\nformat binary_little_endian 1.0\n" + header;
  std::vector<float> values;
  for (int i = 0; i < 60000; ++i) {
    const float x = float(i) / 8;
    const double y = -1.5 * i;
    text += std::to_string(x) + " " + std::to_string(y) + std::string(size_t(i % 7), ' ') + "\t" +
            std::to_string(i % 256) + (i % 3 ? "\n" : " \r\n\n");
    binary += raw(x) + raw(y) + raw(uint8_t(i));
    for (const float value : {x, float(y), float(i % 256)}) values.push_back(value);
  }
  EXPECT_EQ(read_ply(folder.write("text.ply", text)).values, values);
  EXPECT_EQ(read_ply(folder.write("binary.ply", binary)).values, values);
  text.replace(text.rfind("\n", text.size() - 3), 1, "x\n");
  const auto line = std::count(text.begin(), text.end(), '\n');
  expect_error([&] { read_ply(folder.write("text.ply", text)); },
               {"x' in line " + std::to_string(line - 1)});
}

TEST(Ply, NoNumberGoesOnForThousandsOfDigits) {
  const TemporaryFolder folder;
  const auto read = [&](size_t digits) {
    return read_ply(folder.write("a.ply",
                                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                                 "end_header\n" +
                                     std::string(digits, '0') + "7 \n"))
        .values;
  };
  EXPECT_EQ(read(4000), (std::vector<float>{7}));
  expect_error([&] { read(5000); }, {"'00000000000000000000' in line 6 is not a number"});
}

// Read as a whole, text files took six times their size.
TEST(Ply, ReadingTakesTheMemoryOfWhatIsMadeOfIt) {
  const TemporaryFolder folder;
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 4000000\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "end_header\n";
  for (int i = 0; i < 4000000; ++i) text += "0.25 0.5 1.5 1 2 3\n";
  const std::string path = folder.write("a.ply", text);
  std::string().swap(text);
  constexpr double mib = 4e6 / (1 << 20);
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_point_cloud(path).size(), most_points); }),
            0.75 * 28 * mib + 8);
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_ply(path).rows, 4000000u); }), 24 * mib + 8);
}

// The shortest numbers have two characters, and positions are doubles: keeping both beside the
// table took six times the file.
TEST(Ply, ReadingShortNumbersTakesTwiceTheFile) {
  const TemporaryFolder folder;
  constexpr size_t n = 5000000;
  std::string text =
      fmt::format("ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\n", n) +
      "property double y\nproperty double z\nend_header\n";
  for (size_t i = 0; i < n; ++i) text += i % 2 ? "9 9 9\n" : "1 5 7\n";
  const std::string path = folder.write("a.ply", text);
  const double mib = double(text.size()) / (1 << 20);
  std::string().swap(text);
  PointCloud points;
  EXPECT_LT(memory_of([&] { points = read_point_cloud(path); }), 2 * mib + 64);
  ASSERT_EQ(points.size(), most_points);  // rows 0, 2, 4, 5, 7, 9, 10, ...
  EXPECT_EQ(points.xyz[1], 5);
  EXPECT_EQ(points.xyz[3 * 1 + 1], 5);
  EXPECT_EQ(points.xyz[3 * 3 + 1], 9);
  points = {};
  PlyTable table;
  EXPECT_LT(memory_of([&] { table = read_ply(path); }), 2 * mib + 8);
  EXPECT_EQ(table.origin, (std::array<double, 3>{5, 7, 8}));
  EXPECT_EQ(table.values[2 * 3 + 1], -2.f);
  EXPECT_EQ(table.values[3 * 3 + 2], 1.f);
}

// Does not build the whole file in memory beside the table.
TEST(Ply, WritingTakesNoMemoryOfItsOwn) {
  const TemporaryFolder folder;
  PlyTable table{{"x", "y", "z"}, 3000000, std::vector<float>(9000000, 1.5f), {}};
  for (const double away : {0., 1e6}) {
    table.origin = {away, 0, 0};
    EXPECT_LT(memory_of([&] { write_ply(folder.file("a.ply"), table); }), 8);
    EXPECT_EQ(read_ply(folder.file("a.ply")).rows, table.rows);
  }
}
