// SPDX-License-Identifier: Apache-2.0
// Derivatives computed on the host: of guidance by an image, in closed form and by score
// distillation, and of a pixel by the world point seen there (initial velocities).
#include <Eigen/Geometry>

#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "apps/stress/training/request.hpp"
#include "optim/guidance/analytic.hpp"
#include "optim/guidance/sds.hpp"

namespace gflow::stress {

std::vector<Derivative> host_derivatives();  // for the table in derivatives.cpp

namespace {

// -log p(z) up to a constant; p is a mixture with equal weights, means sqrt(a) m, variance s.
double surprise(const std::vector<std::vector<float>>& means, double a, double s,
                const std::vector<double>& z) {
  double p = 0;
  for (const std::vector<float>& m : means) {
    double squared = 0;
    for (size_t i = 0; i < z.size(); ++i)
      squared += std::pow(z[i] - std::sqrt(a) * double(m[i]), 2);
    p += std::exp(-squared / (2 * s));
  }
  return -std::log(p);
}

// The noise of the closed form is sqrt(1 - a) times the gradient of -log p.
Derivative mixture_row() {
  const std::vector<std::vector<float>> means{{.5f, -.2f, .1f, .7f}, {-.4f, .3f, .6f, 0}};
  const double variance = .1, a = .6, s = a * variance + 1 - a;
  const std::vector<double> z{.2f, .05f, .3f, -.4f};
  std::vector<double> nearness, expected(z.size());
  double sum = 0;
  for (const std::vector<float>& m : means) {
    nearness.push_back(std::exp(-surprise({m}, a, s, z)));
    sum += nearness.back();
  }
  for (size_t k = 0; k < means.size(); ++k)
    for (size_t i = 0; i < z.size(); ++i)
      expected[i] +=
          std::sqrt(1 - a) * nearness[k] / sum * (z[i] - std::sqrt(a) * double(means[k][i])) / s;
  std::vector<double> differences =
      slopes([&](const std::vector<double>& x) { return surprise(means, a, s, x); }, z, 1e-3);
  for (double& slope : differences) slope *= std::sqrt(1 - a);
  return {"host: mixture_noise",
          "noised image",
          relative_error(mixture_noise(means, variance, a, {z.begin(), z.end()}), expected),
          relative_error(expected, differences),
          1e-5,
          1e-6};
}

// A mixture of one Gaussian as a denoiser for sds_gradient.
class OneGaussian : public Denoiser {
 public:
  OneGaussian(std::vector<float> mean, double variance)
      : means_{std::move(mean)}, variance_(variance) {}
  std::vector<float> noise(const NoisyView& view, bool) override {
    return mixture_noise(means_, variance_, view.alpha_bar, view.z);
  }
  std::string name() const override { return "one Gaussian"; }

 private:
  std::vector<std::vector<float>> means_;
  double variance_;
};

// The gradient is linear in the noise, so the mean over e and -e is the mean over all noise: w
// sigma / sqrt(a) times the gradient of the mean of -log p(z) by the image x, y = 2 x - 1
// (sds.hpp).
Derivative sds_row() {
  const GuidanceRequest request = some_request(1, 3, 2);
  const std::vector<float>& x = request.views[0].rgb;
  std::vector<float> m = some_values(3, x.size());
  for (float& value : m) value = 2 * value - 1;
  const double variance = .05;
  const NoiseSchedule schedule = NoiseSchedule::scaled_linear();
  const int t = 500;
  const double a = schedule.alphas_cumprod[size_t(t)], sigma = std::sqrt(1 - a);
  const double s = a * variance + 1 - a, weight = (1 - a) * sigma / std::sqrt(a);
  const std::vector<float> noise = gaussian_noise(5, 0, x.size());
  std::vector<float> opposite, found;
  for (const float e : noise) opposite.push_back(-e);
  OneGaussian gaussian(m, variance);
  const auto asked = [&](const std::vector<float>& e) {
    return sds_gradient(gaussian, schedule, request, request.views[0], t, e, 1);
  };
  const std::vector<float> one = asked(noise), other = asked(opposite);
  std::vector<double> expected;
  for (size_t i = 0; i < x.size(); ++i) {
    found.push_back((one[i] + other[i]) / 2);
    expected.push_back(2 * weight * a * (2 * double(x[i]) - 1 - double(m[i])) / s);
  }
  const auto loss = [&](const std::vector<double>& image) {
    double sum = 0;
    for (const double sign : {1., -1.}) {
      std::vector<double> z;
      for (size_t i = 0; i < image.size(); ++i)
        z.push_back(std::sqrt(a) * (2 * image[i] - 1) + sign * sigma * double(noise[i]));
      sum += weight * surprise({m}, a, s, z) / 2;
    }
    return sum;
  };
  return {"host: sds_gradient",
          "image, mean over noise",
          relative_error(found, expected),
          relative_error(expected, slopes(loss, {x.begin(), x.end()}, 1e-3)),
          1e-4,
          1e-6};
}

// All in double. Compared with the chain rule: pixel by camera coordinates, these by world
// coordinates.
Derivative camera_row() {
  Random random(52);
  std::vector<double> found, expected, differences;
  for (int i = 0; i < 50; ++i) {
    Camera camera = some_camera("a", 64, 48);
    camera.fy *= 1.2;
    camera.viewmat.topLeftCorner<3, 3>() =
        Eigen::Quaterniond(1, random.normal(), random.normal(), random.normal())
            .normalized()
            .toRotationMatrix();
    const Eigen::Vector3d ahead(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(3, 5));
    const Eigen::Matrix3d turn = camera.viewmat.topLeftCorner<3, 3>();
    const Eigen::Vector3d point =
        turn.transpose() * (ahead - camera.viewmat.topRightCorner<3, 1>());
    const Eigen::Matrix<double, 2, 3> j = camera.derivative(point);
    // K [x y] / z by camera coordinates, and these by world coordinates.
    const Eigen::Vector3d p = ahead;
    Eigen::Matrix<double, 2, 3> by_camera;
    by_camera << camera.fx / p.z(), 0, -camera.fx * p.x() / (p.z() * p.z()), 0, camera.fy / p.z(),
        -camera.fy * p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> chained = by_camera * turn;
    for (int row = 0; row < 2; ++row) {
      const auto pixel = [&](const std::vector<double>& at) {
        return camera.project({at[0], at[1], at[2]})[row];
      };
      for (const double slope : slopes(pixel, {point.x(), point.y(), point.z()}, 1e-4))
        differences.push_back(slope);
      for (int column = 0; column < 3; ++column) {
        found.push_back(j(row, column));
        expected.push_back(chained(row, column));
      }
    }
  }
  return {"host: Camera::derivative",         "world point", relative_error(found, expected),
          relative_error(found, differences), 1e-12,         1e-6};
}

}  // namespace

std::vector<Derivative> host_derivatives() { return {mixture_row(), sds_row(), camera_row()}; }

}  // namespace gflow::stress
