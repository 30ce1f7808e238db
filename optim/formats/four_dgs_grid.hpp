// SPDX-License-Identifier: Apache-2.0
// Constants of the .4dgs format, shared by reader and writer (specification, sections 4 to 6, and
// its registry).
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
constexpr size_t kVersionByte = 5;  // index within the magic
constexpr std::string_view kModel = "gaussian-birth", kScheme = "uniform-v1";

// A record is a u8 opcode, a u64 length and the content.
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

// Attribute streams of a chunk. All are required; kChannels has the number of channels of each.
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
constexpr int32_t kNeverFades = 1;  // the only flag

enum Mode : uint8_t { raw, delta, constant };
constexpr uint8_t kDeflate = 0, kZstd = 1;

// SH band b has 2 b + 1 coefficients per colour, stored after those of lower bands. A byte spans
// [-4, 4].
constexpr size_t band_size(size_t band) { return 2 * band + 1; }
constexpr size_t band_first(size_t band) { return band * band - 1; }
constexpr double kShLowest = -4, kShStep = 8.0 / 255;

// Bound on positions, velocities and times: products of two stay finite in float.
constexpr double kLargest = 1e15;

// Quantization: value = bin x step for an integer bin. Scales and lives are exp(bin x step),
// positions are origin + bin x step.
struct Grid {
  std::array<double, 3> origin{};
  double position = 0, scale = 0, rotation = 0, color = 0, opacity = 0, motion = 0, time = 0,
         life = 0;
  double sh = 1;  // written for information; readers decode the bytes without it

  // All members but sh, in the order of the file.
  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    for (auto& value : self.origin) field(value);
    for (auto* value : {&self.position, &self.scale, &self.rotation, &self.color, &self.opacity,
                        &self.motion, &self.time, &self.life})
      field(*value);
  }

  // Step of velocities. The velocity error scales with the time a Gaussian is visible, so the step
  // shrinks with it in powers of two (section 6.3). `cutoff` is that of the file.
  double motion_step(bool never_fades, int32_t life_bin, double window, double cutoff) const {
    const double seen = never_fades ? window : std::sqrt(-2 * std::log(cutoff)) * life_of(life_bin);
    const double level = std::ceil(std::log2(std::clamp(seen, 0.02, 2.0) / 0.5));
    return motion * std::exp2(-std::clamp(level, -4.0, 2.0));
  }
  // Step of mean_t: at most 1/20 of the life, but at least time / 1024.
  double time_step(bool never_fades, int32_t life_bin) const {
    const double target = never_fades ? time : std::min(time, 0.05 * life_of(life_bin));
    return time * std::exp2(std::clamp(std::floor(std::log2(target / time)), -10.0, 0.0));
  }
  double life_of(int32_t bin) const { return std::exp(bin * life); }
};

}  // namespace gflow::four_dgs
