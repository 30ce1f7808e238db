// SPDX-License-Identifier: Apache-2.0
// The test reads the file like the viewer's shader and compares it with the model on the device.
#include "optim/eval/splatv.hpp"

#include <cstring>
#include <nlohmann/json.hpp>

#include "optim/eval/views.hpp"
#include "optim/model/as_spacetime.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// IEEE 754 binary16.
double of_half(uint32_t bits) {
  const int exponent = bits >> 10 & 31;
  const double mantissa = bits & 1023;
  const double size =
      exponent ? std::ldexp(1024 + mantissa, exponent - 25) : std::ldexp(mantissa, -24);
  return bits & 0x8000 ? -size : size;
}

struct SplatvFile {
  nlohmann::json chunks;
  std::vector<uint32_t> words;

  explicit SplatvFile(const std::string& bytes) {
    uint32_t head[2];
    std::memcpy(head, bytes.data(), sizeof head);
    EXPECT_EQ(head[0], 0x674bu);
    chunks = nlohmann::json::parse(bytes.substr(8, head[1]));
    words.resize((bytes.size() - 8 - head[1]) / 4);
    std::memcpy(words.data(), bytes.data() + 8 + head[1], 4 * words.size());
  }
  // Half float k of a Gaussian, two per word.
  double half(size_t i, size_t word, int high) const {
    return of_half(words[16 * i + word] >> 16 * high & 0xffff);
  }
  double mean(size_t i, size_t k) const {
    float value;
    std::memcpy(&value, &words[16 * i + k], sizeof value);
    return value;
  }
};

HostModel moving_model() {
  HostModel model;
  model.shape.sh_degree = 0;
  model.shape.duration = 3;
  for (uint i = 0; i < 30; ++i) {
    append_gaussian(model, {noise(1, i), noise(2, i), noise(3, i)}, 0.1f, some_color(i),
                    0.4f * noise(4, i));
    auto& g = model.groups;
    g["means_t"][i] = 1.5f + 1.5f * noise(5, i);
    g["log_scales"][4 * i + 3] = 0.3f * noise(6, i);
    for (uint k = 0; k < 3; ++k) g["half_accelerations"][3 * i + k] = 0.1f * noise(7 + k, i);
    for (uint k = 0; k < 4; ++k) g["turns"][4 * i + k] = 0.3f * noise(10 + k, i);
  }
  return model;
}

TEST(Splatv, IsTheModelAtEveryTimeToTheDigitsOfAHalfFloat) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  const HostModel host = moving_model();
  write_splatv(folder.file("a.splatv"), host, {orbit_views(host, {0}, "-y")[0].camera});
  const SplatvFile file(contents(folder.file("a.splatv")));
  Model model(queue, host);
  GaussiansAt at;
  for (const double t : {0.0, 0.3, 1.0}) {
    model.motion->at(queue, model.parameters, model.time(t), nullptr, at);
    const std::vector<float> means = at.means.read(queue), factors = at.factors.read(queue);
    const std::vector<float> opacities = at.opacities.read(queue);
    size_t compared = 0;
    for (size_t i = 0; i < host.count; ++i) {
      if (!(opacities[i] > 0)) continue;
      ++compared;
      const double dt = t - file.half(i, 15, 0), life = file.half(i, 15, 1);
      const double v[3] = {file.half(i, 8, 0), file.half(i, 8, 1), file.half(i, 9, 0)};
      const double c[3] = {file.half(i, 9, 1), file.half(i, 10, 0), file.half(i, 10, 1)};
      double q[4];
      for (size_t k = 0; k < 4; ++k)
        q[k] = file.half(i, 3 + k / 2, k % 2) + file.half(i, 13 + k / 2, k % 2) * dt;
      const Eigen::Quaterniond turned = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
      const Eigen::Vector3d scales(file.half(i, 5, 0), file.half(i, 5, 1), file.half(i, 6, 0));
      const Eigen::Matrix3d factor = turned.toRotationMatrix() * scales.asDiagonal();
      for (size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(file.mean(i, k) + v[k] * dt + c[k] * dt * dt, means[3 * i + k], 2e-3);
        for (size_t j = 0; j < 3; ++j)
          EXPECT_NEAR(factor(long(k), long(j)), factors[9 * i + 3 * k + j], 5e-4);
      }
      const double opacity = (file.words[16 * i + 7] >> 24) / 255.0;
      EXPECT_NEAR(opacity * std::exp(-std::pow(dt / life, 2)), opacities[i], 5e-3);
    }
    EXPECT_GT(compared, 5u);
  }
  for (size_t i = 0; i < host.count; ++i)
    for (size_t k = 0; k < 3; ++k)
      EXPECT_NEAR((file.words[16 * i + 7] >> 8 * k & 255) / 255.0,
                  0.5 + SH_C0 * host.groups.at("sh0")[3 * i + k], 0.51 / 255);
}

TEST(Splatv, SaysItsTextureAndItsCameras) {
  const TemporaryFolder folder;
  const HostModel host = moving_model();
  write_splatv(folder.file("a.splatv"), host, {orbit_views(host, {0}, "-y")[0].camera});
  const SplatvFile file(contents(folder.file("a.splatv")));
  ASSERT_EQ(file.chunks.size(), 1u);
  const auto& chunk = file.chunks[0];
  EXPECT_EQ(chunk["type"], "splat");
  EXPECT_EQ(chunk["texwidth"], 4096);
  EXPECT_EQ(chunk["texheight"], 1);
  EXPECT_EQ(chunk["size"], 4 * file.words.size());
  EXPECT_EQ(file.words.size(), 4096u * 4);
  EXPECT_EQ(chunk["cameras"].size(), 1u);
  EXPECT_EQ(chunk["cameras"][0]["fx"], orbit_views(host, {0}, "-y")[0].camera.fx);
  for (size_t i = host.count; i < 1024; ++i) EXPECT_EQ(file.words[16 * i + 7], 0u);  // padding
}

TEST(Splatv, ShowsNothingOfAGaussianWhoseSizeOverflows) {
  const TemporaryFolder folder;
  HostModel host = moving_model();
  host.groups["logit_opacities"].assign(host.count, 3.f);
  for (size_t axis = 0; axis < 3; ++axis) host.groups["log_scales"][4 * axis + axis] = 89;
  host.groups["log_scales"][4 * 3] = 88;  // e^88 is a float, but exceeds half floats
  write_splatv(folder.file("a.splatv"), host, {});
  const SplatvFile file(contents(folder.file("a.splatv")));
  for (size_t i = 0; i < host.count; ++i)
    EXPECT_EQ(file.words[16 * i + 7] >> 24, i < 3 ? 0u : 243u) << i;
  EXPECT_EQ(file.half(3, 5, 0), 65504);
}

TEST(Splatv, RefusesOtherMotionModels) {
  const TemporaryFolder folder;
  HostModel host = moving_model();
  host.shape.motion = MotionModelKind::bases;
  expect_error([&] { write_splatv(folder.file("a.splatv"), host, {}); },
               {"spacetime", "native4d", "bases", "ply-sequence"});
  EXPECT_EQ(folder.count(), 0u);
}

TEST(AsSpacetime, FourDimensionalGaussiansLookTheSame) {
  Queue queue = test_queue();
  HostModel host = moving_model();
  for (const char* name : {"velocities", "half_accelerations", "turns"}) host.groups.erase(name);
  host.shape.motion = MotionModelKind::native4d;
  for (uint i = 0; i < host.count; ++i)
    for (uint k = 0; k < 4; ++k) {
      host.groups["quats_r"].push_back(noise(20 + k, i));
      host.groups["quats"][4 * i + k] = noise(30 + k, i);
      host.groups["log_scales"][4 * i + k] = -0.5f + noise(40 + k, i);
    }
  Model model(queue, host), same(queue, as_spacetime(host, "a test"));
  GaussiansAt a, b;
  for (const double t : {0.1, 0.5, 0.8}) {
    model.motion->at(queue, model.parameters, model.time(t), nullptr, a);
    same.motion->at(queue, same.parameters, same.time(t), nullptr, b);
    const auto to_double = [](const std::vector<float>& v) {
      return std::vector<double>(v.begin(), v.end());
    };
    EXPECT_TRUE(
        all_close(b.opacities.read(queue), to_double(a.opacities.read(queue)), {1e-5, 1e-6}));
    const std::vector<float> f = a.factors.read(queue), g = b.factors.read(queue);
    const std::vector<float> m = a.means.read(queue), n = b.means.read(queue);
    const std::vector<float> there = a.opacities.read(queue);
    for (size_t i = 0; i < host.count; ++i) {
      if (!(there[i] > 0)) continue;
      using Matrix = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
      const Eigen::Matrix3f l = Eigen::Map<const Matrix>(&f[9 * i]);
      const Eigen::Matrix3f k = Eigen::Map<const Matrix>(&g[9 * i]);
      EXPECT_LT((l * l.transpose() - k * k.transpose()).norm(), 1e-5f * (l * l.transpose()).norm());
      for (size_t axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(m[3 * i + axis], n[3 * i + axis], 1e-5f * (1 + std::fabs(m[3 * i + axis])));
    }
  }
}

}  // namespace
}  // namespace gflow
