// SPDX-License-Identifier: Apache-2.0
// The reader is tested by a file packed here by hand from the specification; the writer by the
// reader, and its index by the positions it names.
#include "optim/formats/four_dgs.hpp"

#include <zlib.h>

#include <cmath>
#include <cstring>
#include <random>
#include <set>

#include "optim/formats/splat_table.hpp"
#include "shared/sh.h"
#include "tests/support/memory_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

const std::string kMagic = std::string("\x89") + "4DGS1\r\n";

template <class T>
std::string le(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
std::string text(const std::string& s) { return le(uint32_t(s.size())) + s; }
std::string record(uint8_t opcode, const std::string& content) {
  return le(opcode) + le(uint64_t(content.size())) + content;
}
std::string doubles(const std::vector<double>& values) {
  std::string bytes;
  for (const double v : values) bytes += le(v);
  return bytes;
}
std::string zipped(const std::string& bytes) {
  std::string out(compressBound(bytes.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  return out.substr(0, size);
}
// `planes`: the symbols before compression.
std::string stream(int id, int width, int mode, int channels, int count,
                   const std::string& planes) {
  std::string head;
  for (const int byte : {id, width, mode, 0, channels}) head += char(byte);
  const std::string payload = zipped(planes);
  return head + le(uint32_t(count)) + le(uint64_t(payload.size())) + payload;
}
std::string bytes_of(const std::vector<int>& values) {
  return std::string(values.begin(), values.end());
}

// Modifies one part of the hand-made file.
struct HandMade {
  std::string model = "gaussian-birth", scheme = "uniform-v1", chunk_codec;
  int stream_codec = 0, window = 1;
  bool with_life = true;
  uint64_t count = 2;

  // Two Gaussians: one that fades and moves, one that never fades and is rotated by 90 degrees
  // about z.
  std::string bytes() const {
    std::string streams =
        stream(0, 2, 0, 3, 2,
               // bins 1000 -2 3 | 5 6 -70: zigzag 2000 3 6 | 10 12 139
               bytes_of({2000 & 255, 3, 6, 10, 12, 139, 2000 >> 8, 0, 0, 0, 0, 0}));
    streams += stream(1, 1, 1, 3, 2, bytes_of({1, 3, 5, 2, 2, 2}));  // -1 -2 -3, then + 1 each
    streams += stream(77, 3, 9, 1, 1, "later");                      // of a later version
    streams += stream(2, 1, 0, 1, 2, bytes_of({6, 4}));  // w, z are the omitted components
    streams += stream(3, 1, 0, 3, 2, bytes_of({0, 0, 0, 0, 0, 140}));   // 0 0 0 | x y w = 0 0 70
    streams += stream(4, 1, 2, 3, 2, bytes_of({8, 3, 6}));              // g 4, r - g -2, b - g 3
    streams += stream(5, 1, 0, 1, 2, bytes_of({10, 18}));               // 5 9
    streams += stream(6, 1, 0, 3, 2, bytes_of({2, 3, 0, 4, 0, 0}));     // 1 -2 0 | 2 0 0
    streams += stream(7, 1, 0, 1, 2, bytes_of({16, 6}));                // 8 3
    if (with_life) streams += stream(8, 1, 0, 1, 2, bytes_of({5, 0}));  // -3 0
    streams += stream(9, 1, 0, 1, 2, bytes_of({0, 2}));
    streams += stream(10, 1, 0, 1, 2, bytes_of({0, 2 * window}));
    streams[3] = char(stream_codec);
    const std::string block = chunk_codec == "deflate" ? zipped(streams) : streams;
    std::vector<int> band;  // coefficients 0 1 2 of red, green, blue: bytes 128 + 10 c + k, and 127
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) band.push_back(128 + 10 * c + k);
    std::string planes;
    for (const int byte : band) planes += char(2 * byte & 255);
    for (int i = 0; i < 9; ++i) planes += char(254);
    planes += std::string(9, 1) + std::string(9, 0);
    return kMagic +
           record(1, text("") + text("a test") + le(4.0) + le(count) + le(0.1) + text(model) +
                         doubles({0, 0, 0, 1, 1, 1}) + le(uint8_t(1)) + le(uint8_t(2)) + text("")) +
           record(0x90, "private") +
           record(3, text(scheme) +
                         doubles({10, 20, 30, 0.5, 0.1, 0.01, 0.125, 0.1, 0.25, 0.5, 0.5}) +
                         le(uint8_t(3)) + text("") + "appended") +
           record(4, le(uint32_t(2)) + doubles({0, 3, 1, 1.5})) +
           record(5, doubles({0, 3}) + le(uint32_t(0)) + le(uint32_t(2)) + text(chunk_codec) +
                         le(uint64_t(streams.size())) + le(uint64_t(block.size())) + block) +
           record(7, "\x01" + stream(7, 2, 0, 9, 2, planes)) +
           record(2, le(uint64_t(0)) + le(uint64_t(0)) + le(uint32_t(0))) + kMagic;
  }
};

TEST(FourDgs, BytesMeanWhatTheSpecificationSays) {
  const TemporaryFolder folder;
  HandMade packed;
  packed.chunk_codec = "deflate";
  for (const std::string& bytes : {HandMade().bytes(), packed.bytes()}) {
    const MovingSplats scene = read_four_dgs(folder.write("a.4dgs", bytes));
    EXPECT_EQ(scene.duration, 4);
    EXPECT_EQ(scene.cutoff, 0.1);
    ASSERT_EQ(scene.splats.size(), 2u);
    const MovingSplat &a = scene.splats[0], &b = scene.splats[1];
    EXPECT_EQ(a.mean, (std::array<double, 3>{510, 19, 31.5}));
    EXPECT_EQ(b.mean, (std::array<double, 3>{12.5, 23, -5}));
    EXPECT_NEAR(a.scales[0], std::exp(-0.1), 1e-12);
    EXPECT_NEAR(a.scales[2], std::exp(-0.3), 1e-12);
    EXPECT_NEAR(b.scales[0], 1, 1e-12);
    EXPECT_NEAR(b.scales[2], std::exp(-0.2), 1e-12);
    EXPECT_EQ(a.quat, (std::array<double, 4>{1, 0, 0, 0}));
    EXPECT_NEAR(b.quat[0], 0.7, 1e-12);
    EXPECT_NEAR(b.quat[3], std::sqrt(0.51), 1e-12);
    EXPECT_EQ(a.color, (std::array<double, 3>{0.25, 0.5, 0.875}));
    EXPECT_EQ(b.color, a.color);
    EXPECT_NEAR(a.opacity, 0.5, 1e-12);
    EXPECT_NEAR(b.opacity, 0.9, 1e-12);
    // sigma = exp(-3 0.5) = 0.223; half = sqrt(-2 ln 0.1) sigma = 0.479 s, class ceil(-0.06) = 0.
    EXPECT_NEAR(a.life, std::exp(-1.5), 1e-12);
    EXPECT_EQ(a.velocity, (std::array<double, 3>{0.25, -0.5, 0}));
    // 0.05 sigma = 0.0112 of 0.5 is 2^-5.5, class -6.
    EXPECT_NEAR(a.mean_t, 8 * 0.5 / 64, 1e-12);
    // Never fades: half = its window of 0.5 s, class 0; the moment's step is the coarsest.
    EXPECT_TRUE(std::isinf(b.life));
    EXPECT_EQ(b.velocity[0], 0.5);
    EXPECT_EQ(b.mean_t, 1.5);
    EXPECT_EQ(a.begin, 0);
    EXPECT_EQ(a.end, 3);
    EXPECT_EQ(b.begin, 1);
    EXPECT_EQ(b.end, 1.5);
    ASSERT_EQ(scene.sh_rest.size(), 18u);
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(scene.sh_rest[3 * c + k], -4 + double(128 + 10 * c + k) * 8 / 255, 1e-6);
    EXPECT_NEAR(scene.sh_rest[17], -4 + 127 * 8 / 255.0, 1e-6);
  }
}

TEST(FourDgs, AMomentIsWhatTheSpecificationReconstructs) {
  const TemporaryFolder folder;
  const MovingSplats scene = read_four_dgs(folder.write("a.4dgs", HandMade().bytes()));
  // The first has a weight of 0.1 at 0.0625 + 0.479 = 0.541 s.
  EXPECT_EQ(splats_at(scene, 0.54).rows, 1u);
  EXPECT_EQ(splats_at(scene, 0.545).rows, 0u);
  EXPECT_EQ(splats_at(scene, 0.999).rows, 0u);
  EXPECT_EQ(splats_at(scene, 1).rows, 1u);
  EXPECT_EQ(splats_at(scene, 1.5).rows, 0u);
  const double t = 0.3, tau = t - 0.0625;
  SplatTable table = standard_table(splats_at(scene, t), "test");
  const SplatRow row = table.row(0);
  EXPECT_FLOAT_EQ(row.mean[0], float(510 + 0.25 * tau));
  EXPECT_FLOAT_EQ(row.mean[1], float(19 - 0.5 * tau));
  EXPECT_NEAR(opacity_of_logit(*row.logit_opacity), 0.5 * std::exp(-tau * tau / 2 * std::exp(3)),
              1e-6);
  EXPECT_NEAR(color_of_sh0(row.sh0[2]), 0.875, 1e-6);
  EXPECT_NEAR(row.sh_rest[8], -4 + 150 * 8 / 255.0, 1e-6);
}

MovingSplats some_scene(size_t count, int sh_degree) {
  std::mt19937 rng(4);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * double(rng()) / 4294967296.0;
  };
  MovingSplats scene;
  scene.duration = 3;
  scene.sh_degree = sh_degree;
  const size_t rest = size_t(3 * ((sh_degree + 1) * (sh_degree + 1) - 1));
  for (size_t i = 0; i < count; ++i) {
    MovingSplat s;
    for (size_t k = 0; k < 3; ++k) {
      s.mean[k] = uniform(-5, 3);
      s.velocity[k] = i % 3 ? uniform(-1, 1) : 0;
      s.scales[k] = std::exp(uniform(-5, -1));
      s.color[k] = uniform(0, 1);
    }
    double norm = 0;
    for (double& q : s.quat) {
      q = uniform(-1, 1);
      norm += q * q;
    }
    for (double& q : s.quat) q /= std::sqrt(norm);
    s.opacity = uniform(0, 1);
    s.mean_t = uniform(-1, 4);
    if (i % 4) s.life = std::exp(uniform(-3, 1));
    s.begin = 0.25 * std::floor(uniform(0, 6));
    s.end = s.begin + 0.25 * std::ceil(uniform(0, 6));
    s.sh_row = i;
    scene.splats.push_back(s);
    for (size_t k = 0; k < rest; ++k) scene.sh_rest.push_back(float(uniform(-1, 1)));
  }
  return scene;
}

TEST(FourDgs, ComesBackToThePrecisionOfItsGrid) {
  const TemporaryFolder folder;
  const MovingSplats scene = some_scene(200, 3);
  write_four_dgs(folder.file("a.4dgs"), scene);
  const MovingSplats back = read_four_dgs(folder.file("a.4dgs"));
  EXPECT_EQ(back.duration, scene.duration);
  EXPECT_EQ(back.cutoff, scene.cutoff);
  ASSERT_EQ(back.splats.size(), scene.splats.size());
  std::vector<bool> found(200, false);
  for (const MovingSplat& b : back.splats) {  // in another order
    const auto near = [&](const MovingSplat& a) {
      double off = 0;
      for (size_t k = 0; k < 3; ++k) off += std::fabs(a.scales[k] / b.scales[k] - 1);
      return off < 0.01;
    };
    const auto a = std::find_if(scene.splats.begin(), scene.splats.end(), near);
    ASSERT_NE(a, scene.splats.end());
    found[a->sh_row] = true;
    EXPECT_EQ(a->begin, b.begin);
    EXPECT_EQ(a->end, b.end);
    EXPECT_NEAR(a->opacity, b.opacity, 1.01 / 1020);
    EXPECT_EQ(std::isinf(a->life), std::isinf(b.life));
    EXPECT_NEAR(std::isinf(a->life) ? 1 : a->life / b.life, 1, 0.0026);
    double dot = 0;
    for (size_t k = 0; k < 4; ++k) dot += a->quat[k] * b.quat[k];
    EXPECT_GT(std::fabs(dot), 1 - 2e-6);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(a->color[k], b.color[k], 1.01 / 1020);
      for (double t = a->begin; t <= a->end; t += 0.05) {
        if (std::fabs(t - a->mean_t) > 2.45 * a->life) continue;  // not visible
        EXPECT_NEAR(a->mean[k] + a->velocity[k] * (t - a->mean_t),
                    b.mean[k] + b.velocity[k] * (t - b.mean_t), 0.02 * 0.06);  // sizes: 0.05
      }
    }
    for (size_t k = 0; k < 45; ++k)
      EXPECT_NEAR(scene.sh_rest[45 * a->sh_row + k], back.sh_rest[45 * b.sh_row + k], 4.01 / 255);
  }
  EXPECT_EQ(std::count(found.begin(), found.end(), true), 200);
}

// SH coefficients have steps of 1/32 and colours are clamped at 1, but the view-dependent colours
// at the cameras are kept.
TEST(FourDgs, ColoursSeenFromTheEyesAreKept) {
  const TemporaryFolder folder;
  MovingSplats scene = some_scene(40, 2);
  for (int e = 0; e < 9; ++e) scene.eyes.push_back({0.8 * (e % 3) - 1, 0.8 * (e / 3) - 1, -15.0});
  for (MovingSplat& s : scene.splats) {
    s.color[0] = 1.2;
    s.velocity = {};
  }
  const auto off = [&](const MovingSplats& written) {  // root mean square error
    write_four_dgs(folder.file("a.4dgs"), written);
    const MovingSplats back = read_four_dgs(folder.file("a.4dgs"));
    double sum = 0;
    for (const MovingSplat& b : back.splats) {
      const auto a = std::find_if(scene.splats.begin(), scene.splats.end(), [&](const auto& s) {
        return std::fabs(s.scales[0] / b.scales[0] - 1) + std::fabs(s.scales[1] / b.scales[1] - 1) <
               0.01;
      });
      for (double x = -0.9; x < 0.6; x += 0.3) {  // between the camera positions
        const real3 d = make_real3(a->mean[0] - x, a->mean[1], a->mean[2] + 15);
        const ShBasis basis = sh_basis(2, d * (1 / std::sqrt(dot(d, d))));
        for (size_t c = 0; c < 3; ++c) {
          double difference = a->color[c] - b.color[c];
          for (size_t k = 0; k < 8; ++k)
            difference += basis.y[k + 1] * double(scene.sh_rest[8 * (3 * a->sh_row + c) + k] -
                                                  back.sh_rest[8 * (3 * b.sh_row + c) + k]);
          sum += difference * difference;
        }
      }
    }
    return std::sqrt(sum / (40 * 5 * 3));
  };
  MovingSplats blind = scene;
  blind.eyes.clear();
  EXPECT_GT(off(blind), 0.1);
  EXPECT_LT(off(scene), 0.004);
}

TEST(FourDgs, WhatTheFormatCannotHoldIsCutOff) {
  const TemporaryFolder folder;
  MovingSplats scene = some_scene(1, 1);
  scene.splats[0].color = {-0.5, 0.5, 1.5};
  scene.sh_rest[0] = 9;
  scene.sh_rest[1] = -9;
  write_four_dgs(folder.file("a.4dgs"), scene);
  const MovingSplats back = read_four_dgs(folder.file("a.4dgs"));
  EXPECT_EQ(back.splats[0].color[0], 0);
  EXPECT_NEAR(back.splats[0].color[2], 1, 1e-12);
  EXPECT_EQ(back.sh_rest[0], 4);
  EXPECT_EQ(back.sh_rest[1], -4);
}

// As in a player: from the end of the file to the index, and from there to the records of a time.
TEST(FourDgs, TheIndexNamesWholeRecords) {
  const TemporaryFolder folder;
  const MovingSplats scene = some_scene(300, 2);
  write_four_dgs(folder.file("a.4dgs"), scene);
  const std::string bytes = contents(folder.file("a.4dgs"));
  const auto get = [&](auto value, size_t at) {
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  const size_t footer = bytes.size() - 37;
  EXPECT_EQ(bytes.substr(bytes.size() - 8), kMagic);
  EXPECT_EQ(bytes[footer], 2);
  EXPECT_EQ(get(uint64_t{}, footer + 1), 20u);
  const auto summary = get(uint64_t{}, footer + 9);
  EXPECT_EQ(get(uint32_t{}, footer + 25),
            crc32(0, reinterpret_cast<const Bytef*>(&bytes[summary]), uInt(footer - summary)));
  size_t total = 0, chunks = 0, at = summary;
  for (; at < footer; ++chunks) {
    ASSERT_EQ(bytes[at], 8);
    const size_t entry = at + 9;
    const auto chunk = get(uint64_t{}, entry + 16), length = get(uint64_t{}, entry + 24);
    EXPECT_EQ(bytes[chunk], 5);
    EXPECT_EQ(get(uint64_t{}, chunk + 1) + 9, length);
    EXPECT_EQ(get(double{}, chunk + 9), get(double{}, entry));
    EXPECT_EQ(get(double{}, chunk + 17), get(double{}, entry + 8));
    EXPECT_LT(get(double{}, entry), get(double{}, entry + 8));
    total += get(uint32_t{}, entry + 32);
    EXPECT_EQ(get(uint32_t{}, entry + 36), 2u);
    for (size_t band = 0; band < 2; ++band) {
      const size_t range = entry + 40 + 17 * band;
      EXPECT_EQ(size_t(bytes[range]), band + 1);
      EXPECT_EQ(bytes[get(uint64_t{}, range + 1)], 7);
      EXPECT_EQ(get(uint64_t{}, get(uint64_t{}, range + 1) + 1) + 9, get(uint64_t{}, range + 9));
    }
    at = entry + get(uint64_t{}, at + 1);
  }
  EXPECT_EQ(at, footer);
  EXPECT_EQ(total, 300u);
  EXPECT_GT(chunks, 4u);
  EXPECT_LE(chunks, 63u);
}

TEST(FourDgs, IsRefusedAtEveryLength) {
  const TemporaryFolder folder;
  const std::string path = folder.write("by_hand.4dgs", HandMade().bytes());
  write_four_dgs(folder.file("written.4dgs"), some_scene(3, 1));
  for (const std::string& cut : {path, folder.file("written.4dgs")}) {
    read_four_dgs(cut);
    for (size_t length = fs::file_size(cut); length-- > 0;) {
      fs::resize_file(cut, length);
      EXPECT_THROW(read_four_dgs(cut), Error) << length;
    }
  }
}

TEST(FourDgs, DamageIsRefusedOrHarmless) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.4dgs");
  write_four_dgs(path, some_scene(6, 1));
  const std::string good = contents(path);
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const auto put = [&](size_t at, char byte) {
    file.seekp(long(at));
    file.put(byte);
    file.flush();
  };
  size_t refused = 0;
  for (size_t at = 0; at < good.size(); ++at) {
    put(at, char(good[at] ^ 1 << at % 8));
    try {
      for (const float value : splats_at(read_four_dgs(path), 1).values)
        ASSERT_TRUE(std::isfinite(value));
    } catch (const Error&) {
      ++refused;
    }
    put(at, good[at]);
  }
  EXPECT_GT(refused, good.size() / 2);  // compressed parts and the index have checksums
}

TEST(FourDgs, SaysWhatItCannotRead) {
  const TemporaryFolder folder;
  const auto expect = [&](const HandMade& file, std::initializer_list<std::string> words) {
    expect_error([&] { read_four_dgs(folder.write("a.4dgs", file.bytes())); }, words);
  };
  HandMade file;
  file.model = "keyframe-delta";
  expect(file, {"a.4dgs", "keyframe-delta", "gaussian-birth"});
  file = {};
  file.scheme = "another";
  expect(file, {"a.4dgs", "another", "uniform-v1"});
  file = {};
  file.chunk_codec = "zstd";
  expect(file, {"a.4dgs", "zstd", "deflate"});
  file = {};
  file.stream_codec = 1;
  expect(file, {"a.4dgs", "zstd", "deflate"});
  file = {};
  file.window = 2;
  expect(file, {"a.4dgs", "window 2 of 2"});
  file = {};
  file.with_life = false;
  expect(file, {"a.4dgs", "stream 8"});
  file = {};
  file.count = 3;
  expect(file, {"a.4dgs", "3 Gaussians", "has 2"});
  file.count = uint64_t{1} << 60;
  expect(file, {"a.4dgs", "1152921504606846976 Gaussians"});
  // Streams with one value for all Gaussians would make a kilobyte claim this many.
  file.count = uint64_t{1} << 22;
  expect(file, {"a.4dgs", "would decompress to"});
  std::string bytes = HandMade().bytes();
  bytes[5] = '2';
  expect_error([&] { read_four_dgs(folder.write("b.4dgs", bytes)); }, {"b.4dgs", "version '2'"});
  expect_error([&] { read_four_dgs(folder.write("c.4dgs", "ply\nformat")); },
               {"c.4dgs", "not a .4dgs file"});
  // Commands that take a model suggest the conversion.
  expect_error([&] { read_splats(folder.write("d.4dgs", HandMade().bytes())); },
               {"d.4dgs", "gflow import", "--time"});
}

TEST(FourDgs, WritesNothingOfWhatItCannotHold) {
  const TemporaryFolder folder;
  const auto expect = [&](const MovingSplats& scene, std::initializer_list<std::string> words) {
    expect_error([&] { write_four_dgs(folder.file("a.4dgs"), scene); }, words);
    EXPECT_EQ(folder.count(), 0u);
  };
  MovingSplats scene = some_scene(5, 1);
  scene.splats[3].mean[1] = 1e9;
  expect(scene, {"Gaussian", "too far away"});
  scene = some_scene(1, 1);  // its origin is that Gaussian
  scene.splats[0].mean[0] = 1e20;
  expect(scene, {"Gaussian 0", "too far away"});
  scene = some_scene(5, 1);
  scene.splats[3].velocity[1] = std::nan("");
  expect(scene, {"Gaussian 3"});
  scene = some_scene(5, 1);
  scene.sh_rest[20] = std::nanf("");
  expect(scene, {"Gaussian 2"});
  scene.duration = 0;
  expect(scene, {"a.4dgs", "duration"});
}

// Players that store windows as floats compare them with the intervals of chunks.
TEST(FourDgs, TimesAreTheSameAsFloats) {
  const TemporaryFolder folder;
  MovingSplats scene = some_scene(20, 0);
  for (MovingSplat& s : scene.splats) s.begin /= 3, s.end /= 3;
  write_four_dgs(folder.file("a.4dgs"), scene);
  std::set<double> expected, found;
  for (const MovingSplat& s : scene.splats)
    for (const double time : {s.begin, s.end}) expected.insert(double(float(time)));
  for (const MovingSplat& s : read_four_dgs(folder.file("a.4dgs")).splats)
    found.insert({s.begin, s.end});
  EXPECT_EQ(found, expected);
}

TEST(FourDgs, WhatMustComeFirstComesOnce) {
  const TemporaryFolder folder;
  const std::string file = HandMade().bytes();
  const size_t grid = file.find(record(3, text("uniform-v1")).substr(9)) - 9;
  const size_t table = file.find(record(4, le(uint32_t(2)) + doubles({0, 3, 1, 1.5})));
  const size_t chunk = table + record(4, le(uint32_t(2)) + doubles({0, 3, 1, 1.5})).size();
  const std::string quantization = file.substr(grid, table - grid);
  const std::string windows = file.substr(table, chunk - table);
  const size_t end = file.rfind(record(2, std::string(20, '\0')));
  const auto with = [&](size_t at, const std::string& more) {
    read_four_dgs(folder.write("a.4dgs", file.substr(0, at) + more + file.substr(at)));
  };
  with(end, record(0x70, "something else"));
  expect_error([&] { with(table, quantization); }, {"two quantization"});
  expect_error([&] { with(chunk, windows); }, {"two window table"});
  std::string late =
      file.substr(0, table) + file.substr(chunk, end - chunk) + windows + file.substr(end);
  expect_error([&] { read_four_dgs(folder.write("a.4dgs", late)); }, {"damaged"});
}

TEST(FourDgs, EmptyScenesHaveAFile) {
  const TemporaryFolder folder;
  MovingSplats scene;
  scene.duration = 1;
  write_four_dgs(folder.file("a.4dgs"), scene);
  EXPECT_EQ(read_four_dgs(folder.file("a.4dgs")).splats.size(), 0u);
}

TEST(FourDgs, ReadingTakesTheMemoryOfTheGaussiansOnce) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a.4dgs");
  constexpr size_t n = 400000;
  MovingSplats scene;
  scene.duration = 8;
  scene.splats.resize(n);
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (size_t i = 0; i < n; ++i) {
    MovingSplat& s = scene.splats[i];
    s.mean = {uniform(rng), uniform(rng), uniform(rng)};
    s.scales = {0.1, 0.1, 0.1};
    s.opacity = 0.5;
    s.begin = double(i % 8);
    s.end = s.begin + 1;
    s.mean_t = s.begin + 0.5;
  }
  write_four_dgs(path, scene);
  scene = {};
  constexpr double mib = 1 << 20;
  const double splats = n * sizeof(MovingSplat) / mib;
  // In addition the file, and the symbols of one of its eight chunks: 22 per Gaussian and as many
  // values, of 4 bytes each.
  const double chunk = n / 8 * 2 * 22 * 4 / mib, file = double(fs::file_size(path)) / mib;
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_four_dgs(path).splats.size(), n); }),
            splats + chunk + file + 8);
}

}  // namespace
}  // namespace gflow
