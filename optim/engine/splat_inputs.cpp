// SPDX-License-Identifier: Apache-2.0
#include "optim/engine/splat_inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Bits of floats of one sign are in the order of their values; those of NaN and Inf are the
// largest.
constexpr uint32_t kAllBits = 0xffffffff, kWithoutSign = 0x7fffffff, kInfinity = 0x7f800000;

// The largest bits of all values. Lanes make it fast with any optimisation: large inputs are
// checked in every call of Python's rasterization().
uint32_t most_bits(InputValues values, uint32_t mask) {
  constexpr size_t lanes = 16;
  std::array<uint32_t, lanes> most{}, bits{};
  for (size_t i = 0; i < values.size; i += lanes) {
    if (values.size - i < lanes) bits.fill(0);
    std::memcpy(bits.data(), values.data + i, std::min(lanes, values.size - i) * sizeof(float));
    for (size_t k = 0; k < lanes; ++k) most[k] = std::max(most[k], bits[k] & mask);
  }
  return *std::max_element(most.begin(), most.end());
}

bool all_finite(InputValues values) { return most_bits(values, kWithoutSign) < kInfinity; }

// Each finite value is in [0, most].
void require_up_to(float most, const char* expected, InputValues values, size_t n,
                   const std::string& key, const InputSource& source) {
  uint32_t bits;
  std::memcpy(&bits, &most, sizeof bits);
  if (most_bits(values, kAllBits) <= bits) return;
  for (size_t i = 0; i < values.size; ++i)
    if (std::isfinite(values.data[i]) && !(values.data[i] >= 0 && values.data[i] <= most))
      throw Error(fmt::format("{} has {} for Gaussian {}, expected {}", source.input(key),
                              values.data[i], i * n / values.size, expected));
}

void require_pose(InputValues viewmat, const std::string& key, const InputSource& source) {
  const float* m = viewmat.data;
  for (size_t i = 0; i < 16; ++i)
    if (!std::isfinite(m[i]))
      throw Error(fmt::format("{}: camera pose '{}' contains NaN or Inf", source.doing, key));
  constexpr float tolerance = 1e-3f;  // poses are written with few digits
  bool turns = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b <= a; ++b) {
      const float product =
          m[4 * a] * m[4 * b] + m[4 * a + 1] * m[4 * b + 1] + m[4 * a + 2] * m[4 * b + 2];
      turns = turns && std::fabs(product - float(a == b)) < tolerance;
    }
  const float determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                            m[1] * (m[4] * m[10] - m[6] * m[8]) +
                            m[2] * (m[4] * m[9] - m[5] * m[8]);  // < 0: a reflection
  if (!(turns && determinant > 0))
    throw Error(
        fmt::format("{}: camera pose '{}' should be a world-to-camera rotation and translation "
                    "with last row 0 0 0 1",
                    source.doing, key));
}

void require_intrinsics(InputValues intrinsics, const std::string& key, const InputSource& source) {
  const float* K = intrinsics.data;
  if (!(std::isfinite(K[2]) && std::isfinite(K[5]) && K[0] > 0 && K[4] > 0 && std::isfinite(K[0]) &&
        std::isfinite(K[4])))
    throw Error(fmt::format("{}: {} should hold two focal lengths above 0 and a finite centre",
                            source.doing, key));
  if (K[1] != 0 || K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw Error(fmt::format("{}: {} should be fx 0 cx, 0 fy cy, 0 0 1: skew is not supported",
                            source.doing, key));
}

}  // namespace

void require_scales(InputValues values, size_t n, const std::string& key,
                    const InputSource& source) {
  require_up_to(HUGE_VALF, "lengths of at least 0, not logarithms", values, n, key, source);
}

void require_opacities(InputValues values, size_t n, const std::string& key,
                       const InputSource& source) {
  require_up_to(1, "opacities from 0 to 1, not logits", values, n, key, source);
}

void require_finite(InputValues values, const std::string& key, const InputSource& source) {
  if (!all_finite(values)) throw Error(source.input(key) + " contains NaN or Inf");
}

void require_image_size(double width, double height, const std::string& key,
                        const InputSource& source) {
  for (const double side : {width, height})
    if (!(side >= 1 && side <= 65535 && side == std::floor(side)))
      throw Error(fmt::format("{} is {} x {} pixels, each should be a whole number, 1 to 65535",
                              source.input(key), width, height));
}

void require_room_for_images(const DeviceInfo& device, size_t pixels, bool flow, bool backward,
                             const std::string& key, const InputSource& source) {
  const size_t shown = 3 + 1 + 1 + (flow ? 2 : 0);           // rgb, alpha, depth, flow
  const size_t floats = shown + 1 + (backward ? shown : 0);  // and transmittance
  const size_t largest = 3 * sizeof(float) * pixels, all = floats * sizeof(float) * pixels;
  const auto mib = [](uint64_t bytes) { return double(bytes) / (1 << 20); };
  constexpr uint64_t copies = 3;
  const std::string size = fmt::format("of the size in {} '{}'", source.word, key);
  if (all > device.global_memory / copies)
    throw Error(
        fmt::format("{}: images {} need {:.1f} MiB, three times that until they are written, but "
                    "{} has {:.1f} MiB",
                    source.doing, size, mib(all), device.full_name(), mib(device.global_memory)));
  if (largest > device.max_allocation)
    throw Error(fmt::format(
        "{}: an image {} needs {:.1f} MiB, but {} allocates at most {:.1f} MiB at once",
        source.doing, size, mib(largest), device.full_name(), mib(device.max_allocation)));
}

PinholeCamera camera_of(InputValues viewmat, const std::string& viewmat_key, InputValues K,
                        const std::string& K_key, int width, int height, float near_plane,
                        const InputSource& source) {
  require_pose(viewmat, viewmat_key, source);
  require_intrinsics(K, K_key, source);
  PinholeCamera camera{};
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) camera.rotation[3 * row + col] = viewmat.data[4 * row + col];
    camera.translation[row] = viewmat.data[4 * row + 3];
  }
  camera.fx = K.data[0];
  camera.fy = K.data[4];
  camera.cx = K.data[2];
  camera.cy = K.data[5];
  camera.near_plane = near_plane;
  camera.width = width;
  camera.height = height;
  return camera;
}

void mark_broken(InputValues values, std::vector<char>& broken) {
  if (all_finite(values)) return;
  for (size_t i = 0; i < values.size; ++i)
    if (!std::isfinite(values.data[i])) broken[i * broken.size() / values.size] = 1;
}

std::vector<int32_t> broken_rows(const std::vector<char>& broken) {
  std::vector<int32_t> rows;
  for (size_t i = 0; i < broken.size(); ++i)
    if (broken[i]) rows.push_back(int32_t(i));
  return rows;
}

}  // namespace gflow
