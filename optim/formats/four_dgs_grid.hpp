// SPDX-License-Identifier: Apache-2.0
// Numbers of the .4dgs format that writer and reader share (specification, sections 4 to 6, and its
// registry).
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace gflow::four_dgs {

constexpr std::string_view kMagic(
    "\x89"
    "4DGS1\r\n",
    8);
constexpr size_t kVersionByte = 5;  // of the magic
constexpr std::string_view kModel = "gaussian-birth", kScheme = "uniform-v1";

// Records: u8 opcode, u64 length, content.
constexpr size_t kRecordHead = 9, kFooterSize = 20;
enum Opcode : uint8_t {
  header = 0x01,
  footer = 0x02,
  quantization = 0x03,
  windows = 0x04,
  chunk = 0x05,
  sh_band = 0x07,
  chunk_index = 0x08,
  camera = 0x0A,
};

// Attribute streams of a chunk. All are required, and each has this many channels.
enum Attribute : uint8_t {
  position,
  scale,
  rotation_index,
  rotation,
  color,
  opacity,
  motion,
  mean_t,
  life,
  flags,
  window,
  attribute_count,
};
constexpr std::array<uint8_t, attribute_count> kChannels{3, 3, 1, 3, 3, 1, 3, 1, 1, 1, 1};
constexpr int32_t kNeverFades = 1;  // the one flag

enum Mode : uint8_t { raw, delta, constant };
constexpr uint8_t kDeflate = 0, kZstd = 1;

// Coefficients of spherical harmonics of band b: 2 b + 1 a colour, after those of lower bands; each
// a byte that stands for a value in [-4, 4].
constexpr size_t band_size(size_t band) { return 2 * band + 1; }
constexpr size_t band_first(size_t band) { return band * band - 1; }
constexpr double kShLowest = -4, kShStep = 8.0 / 255;

// Places, velocities and times are below this: their products fit a float.
constexpr double kLargest = 1e15;

// A value is its whole number ("bin") times a step; scales and lives are exp of that, positions
// count from the origin.
struct Grid {
  std::array<double, 3> origin{};
  double position = 0, scale = 0, rotation = 0, color = 0, opacity = 0, motion = 0, time = 0,
         life = 0;
  double sh = 1;  // says what the writer did; bytes are used as they are

  // All of them but sh, in the order of the file.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    for (auto& value : self.origin) field(value);
    for (auto* value : {&self.position, &self.scale, &self.rotation, &self.color, &self.opacity,
                        &self.motion, &self.time, &self.life})
      field(*value);
  }

  // A velocity matters by how far it carries while its Gaussian is seen, so its step follows the
  // time that is, in powers of two (section 6.3). cutoff: of the file.
  double motion_step(bool never_fades, int32_t life_bin, double window, double cutoff) const {
    const double seen = never_fades ? window : std::sqrt(-2 * std::log(cutoff)) * life_of(life_bin);
    const double level = std::ceil(std::log2(std::clamp(seen, 0.02, 2.0) / 0.5));
    return motion * std::exp2(-std::clamp(level, -4.0, 2.0));
  }
  // And a moment counts in lives.
  double time_step(bool never_fades, int32_t life_bin) const {
    const double target = never_fades ? time : std::min(time, 0.05 * life_of(life_bin));
    return time * std::exp2(std::clamp(std::floor(std::log2(target / time)), -10.0, 0.0));
  }
  double life_of(int32_t bin) const { return std::exp(bin * life); }
};

}  // namespace gflow::four_dgs
