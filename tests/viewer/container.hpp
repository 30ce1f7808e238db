// SPDX-License-Identifier: Apache-2.0
// Reads the bytes of view_model_bytes() as the page does.
#pragma once
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace gflow {

struct Container {
  nlohmann::json header;
  std::map<std::string, std::vector<float>> arrays;
};

// The values of an array, as numbers of `size` bytes each.
inline std::vector<uint32_t> raw_values(const std::string& bytes, size_t count, size_t size,
                                        bool planes) {
  std::vector<uint32_t> values(count, 0);
  for (size_t i = 0; i < count; ++i)
    for (size_t k = 0; k < size; ++k)
      values[i] |= uint32_t(uint8_t(bytes[planes ? k * count + i : i * size + k])) << (8 * k);
  return values;
}

inline std::vector<float> values_of(const nlohmann::json& entry, const std::string& arrays) {
  const std::vector<size_t> shape = entry["shape"];
  size_t count = 1;
  for (const size_t n : shape) count *= n;
  const std::string type = entry["type"];
  const size_t size = type == "float32" ? 4 : 2, offset = entry["offset"];
  EXPECT_EQ(offset % 8, 0u);
  EXPECT_LE(offset + count * size, arrays.size());
  std::vector<uint32_t> raw =
      raw_values(arrays.substr(offset, count * size), count, size, entry.value("planes", false));
  const size_t row = count / std::max<size_t>(shape[0], 1), width = shape.back();
  if (entry.value("differences", false))
    for (size_t i = row; i < count; ++i)
      raw[i] = ((raw[i] >> 1 ^ (raw[i] & 1 ? 0xffff : 0)) + raw[i - row]) & 0xffff;
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) {
    if (type == "float32") std::memcpy(&values[i], &raw[i], 4);
    if (type == "float16")
      values[i] = float(Eigen::numext::bit_cast<Eigen::half>(uint16_t(raw[i])));
    if (type == "uint16")
      values[i] = float(double(raw[i]) * double(entry["scale"][i % width]) +
                        double(entry["shift"][i % width]));
  }
  return values;
}

inline Container container_of(const std::string& bytes) {
  EXPECT_EQ(bytes.substr(0, 8), "GFLOWVM1");
  const size_t length = raw_values(bytes.substr(8, 4), 1, 4, false)[0];
  EXPECT_EQ((12 + length) % 8, 0u);
  Container container{nlohmann::json::parse(bytes.substr(12, length)), {}};
  const std::string arrays = bytes.substr(12 + length);
  for (const auto& [name, entry] : container.header["arrays"].items())
    container.arrays[name] = values_of(entry, arrays);
  return container;
}

}  // namespace gflow
