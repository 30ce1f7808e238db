// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/camera_fit.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "optim/scene/camera_correction.hpp"

namespace gflow {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kReductions[] = {8, 4, 2, 1};  // of the images, one after the other
constexpr int kIterations = 4;               // at each of them
constexpr int kLeastSide = 16;               // [px] of a reduced image
constexpr float kKnee = 0.1f;                // larger differences of colour count linearly
constexpr double kStep = 0.25;               // [px of the reduced image] of the differences
constexpr double kEnough = 0.02;             // [px] smaller corrections end a reduction

// Planes [3, h / n, w / n] of means over n x n pixels.
std::vector<float> reduced_planes(const std::vector<float>& planes, int width, int height, int n) {
  const int w = width / n, h = height / n;
  std::vector<float> small;
  small.reserve(size_t(3 * w * h));
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        float sum = 0;
        for (int v = 0; v < n; ++v) {
          const size_t row = size_t(c * height + y * n + v) * size_t(width) + size_t(x * n);
          for (int u = 0; u < n; ++u) sum += planes[row + size_t(u)];
        }
        small.push_back(sum / float(n * n));
      }
  return small;
}

class Fit {
 public:
  Fit(Queue& queue, Model& model, Renderer& renderer, const Shot& shot, const Camera& start,
      double depth, const Image& truth, const Image* counted)
      : queue_(queue),
        model_(model),
        renderer_(renderer),
        shot_(shot),
        camera_(start),
        depth_(depth),
        truth_(truth.pixels.size()),
        counted_(counted) {
    const size_t pixels = size_t(camera_.width) * size_t(camera_.height);
    for (size_t i = 0; i < pixels; ++i)
      for (size_t c = 0; c < 3; ++c) truth_[c * pixels + i] = float(truth.pixels[3 * i + c]) / 255;
  }

  Eigen::Matrix4d run() {
    for (const int reduction : kReductions)
      if (std::min(camera_.width, camera_.height) / reduction >= kLeastSide) fit_at(reduction);
    return camera_.viewmat;
  }

 private:
  Eigen::Matrix4d moved(const Vector6& x) const {
    return CameraCorrection::of(x).applied(camera_.viewmat, depth_);
  }

  // What the pose shows minus the image, of reduced images [3 h w]; 0 where pixels do not count.
  std::vector<float> differences(const Eigen::Matrix4d& pose, int reduction) {
    Camera camera = camera_;
    camera.viewmat = pose;
    shot_.view.camera = shot_.view.camera_t2 = pinhole(camera, shot_.view.camera.near_plane);
    renderer_.forward(queue_, model_, shot_);
    std::vector<float> planes = renderer_.images().rgb.read(queue_);
    const size_t pixels = planes.size() / 3;
    for (size_t i = 0; i < planes.size(); ++i)
      planes[i] = counted_ && !counted_->pixels[i % pixels] ? 0 : planes[i] - truth_[i];
    return reduced_planes(planes, camera.width, camera.height, reduction);
  }

  static double cost(const std::vector<float>& differences) {
    double sum = 0;
    for (const float d : differences) {
      const float a = std::fabs(d);
      sum += double(a < kKnee ? a * a : kKnee * (2 * a - kKnee));
    }
    return sum;
  }

  void fit_at(int reduction) {
    const double step = kStep * reduction / camera_.fx;
    std::vector<float> now = differences(camera_.viewmat, reduction);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      std::vector<std::vector<float>> slopes;
      for (int k = 0; k < 6; ++k)
        slopes.push_back(differences(moved(step * Vector6::Unit(k)), reduction));
      Matrix6 a = Matrix6::Zero();
      Vector6 b = Vector6::Zero();
      for (size_t i = 0; i < now.size(); ++i) {
        const double weight =
            std::min(1.0, double(kKnee) / std::max(1e-6, double(std::fabs(now[i]))));
        Vector6 j;
        for (int k = 0; k < 6; ++k) j[k] = (double(slopes[size_t(k)][i]) - double(now[i])) / step;
        a += weight * j * j.transpose();
        b += weight * double(now[i]) * j;
      }
      a.diagonal() *= 1 + 1e-4;
      a.diagonal().array() += 1e-9 * a.trace();
      const Vector6 x = -a.ldlt().solve(b);
      if (!x.allFinite()) return;
      const Eigen::Matrix4d pose = moved(x);
      std::vector<float> then = differences(pose, reduction);
      if (!(cost(then) < cost(now))) return;
      camera_.viewmat = pose;
      now = std::move(then);
      if (x.norm() * camera_.fx < kEnough * reduction) return;
    }
  }

  Queue& queue_;
  Model& model_;
  Renderer& renderer_;
  Shot shot_;
  Camera camera_;
  double depth_;
  std::vector<float> truth_;  // [3, H, W]
  const Image* counted_;
};

}  // namespace

Eigen::Matrix4d fitted_pose(Queue& queue, Model& model, Renderer& renderer, const Shot& shot,
                            const Camera& start, double depth, const Image& truth,
                            const Image* counted) {
  return Fit(queue, model, renderer, shot, start, depth, truth, counted).run();
}

}  // namespace gflow
