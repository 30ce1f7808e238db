// SPDX-License-Identifier: Apache-2.0
// Middlebury .flo format, little-endian: float tag 202021.25 ("PIEH"), int width, int height, then
// u, v per pixel. Colour code of Baker et al. 2011 (A Database and Evaluation Methodology for
// Optical Flow): a wheel of 55 hues, spaced so that neighbouring hues look equally different.
#include "optim/formats/flo.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

constexpr float tag = 202021.25f;
constexpr float unknown = 1e10f;
constexpr float known_below = 1e9f;
constexpr int largest_side = 1 << 15;

template <class T>
T value_at(const Bytes& bytes, size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

using Color = std::array<float, 3>;  // 0..1

// Each arc runs from one pure colour to the next: one channel rises or falls over `steps` hues.
std::vector<Color> make_wheel() {
  struct Arc {
    int steps, channel;
    bool rises;
    Color from;
  };
  const Arc arcs[] = {{15, 1, true, {1, 0, 0}}, {6, 0, false, {1, 1, 0}},
                      {4, 2, true, {0, 1, 0}},  {11, 1, false, {0, 1, 1}},
                      {13, 0, true, {0, 0, 1}}, {6, 2, false, {1, 0, 1}}};
  std::vector<Color> wheel;
  for (const Arc& arc : arcs)
    for (int i = 0; i < arc.steps; ++i) {
      Color color = arc.from;
      const float part = std::floor(255.f * float(i) / float(arc.steps)) / 255.f;
      color[size_t(arc.channel)] = arc.rises ? part : 1 - part;
      wheel.push_back(color);
    }
  return wheel;
}

// Colour of a flow vector; length 1 is full saturation.
Color wheel_color(const std::vector<Color>& wheel, float u, float v) {
  const float radius = std::sqrt(u * u + v * v);
  const float turn = (std::atan2(-v, -u) / float(M_PI) + 1) / 2;  // [0, 1], 0 = to the right
  const float position = turn * float(wheel.size() - 1);
  const size_t first = std::min(size_t(position), wheel.size() - 1);
  const size_t second = (first + 1) % wheel.size();
  const float part = position - float(first);
  Color color;
  for (size_t c = 0; c < 3; ++c) {
    const float hue = (1 - part) * wheel[first][c] + part * wheel[second][c];
    color[c] = radius <= 1 ? 1 - radius * (1 - hue) : hue * .75f;
  }
  return color;
}

float longest_valid(const FlowField& flow) {
  float longest = 0;
  for (size_t i = 0; i < flow.valid.size(); ++i)
    if (flow.valid[i]) longest = std::max(longest, std::hypot(flow.uv[2 * i], flow.uv[2 * i + 1]));
  return longest;
}

void check_sizes(const FlowField& flow, const char* doing) {
  const size_t n = size_t(flow.width) * size_t(flow.height);
  if (flow.width < 1 || flow.height < 1 || flow.uv.size() != 2 * n || flow.valid.size() != n)
    throw Error(fmt::format("cannot {} a flow of {}x{} with {} values and {} validity flags", doing,
                            flow.width, flow.height, flow.uv.size(), flow.valid.size()));
}

}  // namespace

FlowField zero_flow(int width, int height) {
  const size_t n = size_t(width) * size_t(height);
  return {width, height, std::vector<float>(2 * n), std::vector<uint8_t>(n, 1)};
}

FlowField read_flo(const std::string& path) {
  int width = 0, height = 0;
  const auto length_of = [&](const Bytes& bytes) {
    if (bytes.size() < 12 || value_at<float>(bytes, 0) != tag)
      throw Error(fmt::format("cannot read flow {}: it is not a .flo file", path));
    width = value_at<int32_t>(bytes, 4);
    height = value_at<int32_t>(bytes, 8);
    if (width < 1 || height < 1 || width > largest_side || height > largest_side)
      throw Error(fmt::format("cannot read flow {}: its size is {}x{}, expected sides of 1 to {}",
                              path, width, height, largest_side));
    return 12 + 8 * size_t(width) * size_t(height);
  };
  const Bytes bytes = read_file_or_gzip(path, length_of);
  const size_t n = (length_of(bytes) - 12) / 8;
  if (bytes.size() != 12 + 8 * n)
    throw Error(fmt::format("cannot read flow {}: it has {} bytes, but size {}x{} needs {}", path,
                            bytes.size(), width, height, 12 + 8 * n));
  FlowField flow = zero_flow(width, height);
  std::memcpy(flow.uv.data(), bytes.data() + 12, 8 * n);
  for (size_t i = 0; i < n; ++i) {
    float &u = flow.uv[2 * i], &v = flow.uv[2 * i + 1];
    // NaN and Inf fail both comparisons.
    flow.valid[i] = std::fabs(u) <= known_below && std::fabs(v) <= known_below;
    if (!flow.valid[i]) u = v = 0;
  }
  return flow;
}

void write_flo(const std::string& path, const FlowField& flow) {
  check_sizes(flow, "write");
  std::vector<float> stored = flow.uv;
  for (size_t i = 0; i < flow.valid.size(); ++i)
    if (!flow.valid[i]) stored[2 * i] = stored[2 * i + 1] = unknown;
  const int32_t size[2] = {flow.width, flow.height};
  std::string bytes(12 + stored.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), &tag, 4);
  std::memcpy(bytes.data() + 4, size, 8);
  std::memcpy(bytes.data() + 12, stored.data(), stored.size() * sizeof(float));
  const bool zipped = path.size() > 3 && path.compare(path.size() - 3, 3, ".gz") == 0;
  if (zipped)
    write_file_atomically(path, gzip(bytes));
  else
    write_file_atomically(path, bytes);
}

FlowImage color_wheel(const FlowField& flow, float longest) {
  check_sizes(flow, "draw");
  if (!(longest > 0)) longest = longest_valid(flow);
  if (!(longest > 0)) longest = 1;  // nothing moves: all white
  const std::vector<Color> wheel = make_wheel();
  FlowImage image{flow.width, flow.height, std::vector<uint8_t>(3 * flow.valid.size())};
  for (size_t i = 0; i < flow.valid.size(); ++i) {
    if (!flow.valid[i]) continue;
    const Color color = wheel_color(wheel, flow.uv[2 * i] / longest, flow.uv[2 * i + 1] / longest);
    for (size_t c = 0; c < 3; ++c) image.rgb[3 * i + c] = uint8_t(255 * color[c]);
  }
  return image;
}

}  // namespace gflow
