// SPDX-License-Identifier: Apache-2.0
// File layout (antimatter15/splaTV, hybrid.js): u32 magic, u32 length of a JSON list of chunks,
// that list, the chunks. The one chunk "splat" is a texture of 32-bit words, 4096 x 4 words wide,
// 16 words per Gaussian; h2 is two half floats in a word, the first in the low bits:
//   0-2 mean f32 | 3, 4 quaternion w x y z h2 | 5 scales x y h2, 6 z h2
//   7 red green blue opacity u8
//   8-12 velocity, half acceleration, third order, x y z each, h2
//   13, 14 turn h2 | 15 t0, life h2
// A viewer evaluates it at time t in [0, 1] with tau = t - t0 as
//   mean + velocity tau + half_acceleration tau^2 + ..., (quat + turn tau)/|...|,
//   opacity exp(-(tau / life)^2), so life = sqrt(2) standard deviations.
#include "optim/eval/splatv.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "optim/eval/views.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/model/as_spacetime.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

constexpr uint32_t kMagic = 0x674b;
constexpr size_t kTexels = 4096, kWords = 16;     // texels per texture row; words per Gaussian
constexpr size_t kAcross = kTexels * 4 / kWords;  // Gaussians per texture row

uint16_t half(double value) { return Eigen::half(float(std::clamp(value, -65504.0, 65504.0))).x; }
uint32_t halves(double low, double high) { return half(low) | uint32_t(half(high)) << 16; }

uint32_t byte(double value) { return uint32_t(std::clamp(std::round(255 * value), 0.0, 255.0)); }

using Vec3 = std::array<double, 3>;
using Vec4 = std::array<double, 4>;

template <size_t n>
std::array<double, n> row(const HostModel& model, const char* group, size_t i) {
  std::array<double, n> values;
  for (size_t k = 0; k < n; ++k) values[k] = model.groups.at(group)[n * i + k];
  return values;
}

// A Gaussian in units of the video's length, relative to the t0 that a half float can represent;
// the path is the same.
struct FittedPath {
  Vec3 mean, velocity, half_acceleration;
  Vec4 quat, turn;
  double t0, life;
};

FittedPath path_of(const HostModel& model, size_t i) {
  const double duration = model.shape.duration;
  FittedPath p{row<3>(model, "means", i),
               row<3>(model, "velocities", i),
               row<3>(model, "half_accelerations", i),
               row<4>(model, "quats", i),
               row<4>(model, "turns", i),
               row<1>(model, "means_t", i)[0] / duration,
               std::sqrt(2.0) * std::exp(row<4>(model, "log_scales", i)[3]) / duration};
  const double t0 = double(float(Eigen::half(float(p.t0)))), shift = t0 - p.t0;
  for (size_t k = 0; k < 3; ++k) {
    double &m = p.mean[k], &v = p.velocity[k], &c = p.half_acceleration[k];
    v *= duration;
    c *= duration * duration;
    m += (v + c * shift) * shift;
    v += 2 * c * shift;
  }
  double norm = 0;
  for (size_t k = 0; k < 4; ++k) {
    p.turn[k] *= duration;
    p.quat[k] += p.turn[k] * shift;
    norm += p.quat[k] * p.quat[k];
  }
  norm = std::sqrt(norm);
  if (!(norm > 0)) {
    p.quat = {1, 0, 0, 0};
    norm = 1;
  }
  for (size_t k = 0; k < 4; ++k) {
    p.quat[k] /= norm;
    p.turn[k] /= norm;
  }
  p.t0 = t0;
  return p;
}

void put(const HostModel& model, size_t i, uint32_t* words) {
  const FittedPath p = path_of(model, i);
  const Vec4 log_scales = row<4>(model, "log_scales", i);
  const Vec3 sh0 = row<3>(model, "sh0", i);
  const Vec3 &v = p.velocity, &c = p.half_acceleration;
  for (size_t k = 0; k < 3; ++k) {
    const float mean = float(p.mean[k]);
    std::memcpy(words + k, &mean, sizeof mean);
    words[7] |= byte(color_of_sh0(sh0[k])) << 8 * k;
  }
  const double largest = std::max({log_scales[0], log_scales[1], log_scales[2]});
  if (std::isfinite(std::exp(float(largest))))  // else it is not rendered
    words[7] |= byte(opacity_of_logit(model.groups.at("logit_opacities")[i])) << 24;
  words[3] = halves(p.quat[0], p.quat[1]);
  words[4] = halves(p.quat[2], p.quat[3]);
  words[5] = halves(std::exp(log_scales[0]), std::exp(log_scales[1]));
  words[6] = halves(std::exp(log_scales[2]), 0);
  words[8] = halves(v[0], v[1]);
  words[9] = halves(v[2], c[0]);
  words[10] = halves(c[1], c[2]);
  words[13] = halves(p.turn[0], p.turn[1]);
  words[14] = halves(p.turn[2], p.turn[3]);
  words[15] = halves(p.t0, p.life);
}

void append(std::string& bytes, uint32_t word) {
  bytes.append(reinterpret_cast<const char*>(&word), sizeof word);
}

}  // namespace

void write_splatv(const std::string& path, const HostModel& any,
                  const std::vector<Camera>& cameras) {
  const HostModel model =
      as_spacetime(any, "a .splatv file supports only the motion models spacetime and native4d");
  const size_t rows = std::max<size_t>(1, (model.count + kAcross - 1) / kAcross);
  std::vector<uint32_t> texture(rows * kTexels * 4, 0);
  for (size_t i = 0; i < model.count; ++i) put(model, i, &texture[kWords * i]);
  // Padding of the last row: opacity 0, and a life above 0.
  for (size_t i = model.count; i < rows * kAcross; ++i) texture[kWords * i + 15] = halves(0, 1);
  const size_t size = texture.size() * sizeof(uint32_t);
  using Json = nlohmann::ordered_json;
  const Json chunk{{"type", "splat"},
                   {"size", size},
                   {"texwidth", kTexels},
                   {"texheight", rows},
                   {"cameras", Json::parse(cameras_json(cameras))}};
  const std::string json = Json::array({chunk}).dump();
  std::string bytes;
  append(bytes, kMagic);
  append(bytes, uint32_t(json.size()));
  bytes += json;
  bytes.append(reinterpret_cast<const char*>(texture.data()), size);
  write_file_atomically(path, bytes);
}

}  // namespace gflow
