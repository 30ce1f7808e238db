// SPDX-License-Identifier: Apache-2.0
#include "optim/init/stereo_points.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "runtime/base/parallel.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr int kWidth = 320;        // images are compared at about this width [px]
constexpr int kTries = 6;          // tested pixels per requested point
constexpr float kMatch = 12;       // largest mean colour difference of a match [grey levels]
constexpr float kDistinct = 0.5f;  // the same, relative to the mean over all depths

// A camera and its image, both downscaled.
struct Eye {
  Camera camera;
  std::vector<float> rgb;  // [H, W, 3]

  const float* at(int x, int y) const {
    return &rgb[3 * (size_t(y) * size_t(camera.width) + size_t(x))];
  }
  bool holds(int x, int y) const {  // whether a 3 x 3 patch around the pixel fits
    return x >= 1 && y >= 1 && x < camera.width - 1 && y < camera.height - 1;
  }
};

// counted: null if all pixels count. Where some do not, the colour is NaN, which matches nothing.
Eye eye_of(const Camera& camera, const std::vector<uint8_t>& rgb, const Image* counted = nullptr) {
  const int by = std::max(1, (camera.width + kWidth / 2) / kWidth);
  Eye eye{reduced(camera, by), {}};
  for (int y = 0; y < eye.camera.height; ++y)
    for (int x = 0; x < eye.camera.width; ++x)
      for (int c = 0; c < 3; ++c) {
        int sum = 0;
        bool counts = true;
        for (int v = 0; v < by; ++v)
          for (int u = 0; u < by; ++u) {
            const size_t pixel = size_t(y * by + v) * size_t(camera.width) + size_t(x * by + u);
            sum += rgb[3 * pixel + size_t(c)];
            counts &= !counted || counted->pixels[pixel] > 0;
          }
        eye.rgb.push_back(counts ? float(sum) / float(by * by) : std::nanf(""));
      }
  return eye;
}

std::vector<Eye> eyes_of(const Scene& scene, FrameStore& frames,
                         const std::vector<StaticCamera>& static_cameras) {
  std::vector<Eye> eyes;
  if (static_cameras.size() > 1) {
    for (const StaticCamera& static_camera : static_cameras)
      eyes.push_back(eye_of(static_camera.camera, static_camera.usual));
    return eyes;
  }
  for (const Frame& frame : scene.train)
    if (frame.step == scene.steps / 2)
      eyes.push_back(
          eye_of(frames.camera(frame), frames.rgb(frame)->pixels, frames.counted(frame).get()));
  return eyes;
}

// Mean colour difference of two 3 x 3 patches.
float difference(const Eye& a, int ax, int ay, const Eye& b, int bx, int by) {
  float sum = 0;
  for (int v = -1; v <= 1; ++v)
    for (int u = -1; u <= 1; ++u) {
      const float *p = a.at(ax + u, ay + v), *q = b.at(bx + u, by + v);
      for (int c = 0; c < 3; ++c) sum += std::fabs(p[c] - q[c]);
    }
  return sum / 27;
}

// Depths tested along a pixel's ray, uniform in 1 / depth.
struct Depths {
  double near, far;
  int count;
  double at(int k) const {
    const double share = double(k) / (count - 1);
    return 1 / ((1 - share) / near + share / far);
  }
};

Eigen::Vector3d on_ray(const Eye& eye, double x, double y, double depth) {
  const Camera& c = eye.camera;
  const Eigen::Vector3d p((x - c.cx) / c.fx * depth, (y - c.cy) / c.fy * depth, depth);
  return c.position() + c.viewmat.topLeftCorner<3, 3>().transpose() * p;
}

// Enough depths that the step between two moves the image centre by at most a pixel in any other
// camera.
Depths depths_of(const Scene& scene, const std::vector<Eye>& eyes) {
  Depths depths{scene.near, scene.far, 0};
  if (!(depths.near > 0 && depths.far > depths.near)) {
    const Eigen::Vector3d middle = focus_point(scene);
    double distance = 0;
    for (const Eye& eye : eyes)
      distance += (eye.camera.position() - middle).norm() / double(eyes.size());
    depths.near = distance / 4;
    depths.far = distance * 8;
  }
  double longest = 0;
  for (const Eye& from : eyes)
    for (const Eye& to : eyes) {
      const Camera &a = from.camera, &b = to.camera;
      const Eigen::Vector3d near = on_ray(from, a.cx, a.cy, depths.near);
      const Eigen::Vector3d far = on_ray(from, a.cx, a.cy, depths.far);
      const auto ahead = [&](const Eigen::Vector3d& p) {
        return (b.viewmat * p.homogeneous()).z() > 0;
      };
      if (ahead(near) && ahead(far))
        longest = std::max(longest, (b.project(near) - b.project(far)).norm());
    }
  depths.count = int(std::clamp(longest, 32., 512.));
  return depths;
}

// Depth of a pixel of eyes[i] at which the others agree best, and whether the match is distinct.
struct Match {
  double depth = 0;
  bool found = false;
};

Match match_of(const std::vector<Eye>& eyes, size_t i, int x, int y, const Depths& depths) {
  double sum = 0;
  int seen = 0;
  float best = 1e9f;
  Match match;
  std::vector<float> differences;
  for (int k = 0; k < depths.count; ++k) {
    const double depth = depths.at(k);
    const Eigen::Vector3d p = on_ray(eyes[i], x + 0.5, y + 0.5, depth);
    differences.clear();
    for (size_t j = 0; j < eyes.size(); ++j) {
      const Camera& camera = eyes[j].camera;
      if (j == i || !((camera.viewmat * p.homogeneous()).z() > 0)) continue;
      const Eigen::Vector2d at = camera.project(p);
      if (!(at.x() >= 0 && at.y() >= 0 && at.x() < camera.width && at.y() < camera.height))
        continue;
      const int u = int(at.x()), v = int(at.y());
      if (!eyes[j].holds(u, v)) continue;
      const float found = difference(eyes[i], x, y, eyes[j], u, v);
      if (!std::isnan(found)) differences.push_back(found);
    }
    const size_t needed = std::min<size_t>(2, eyes.size() - 1);
    if (differences.size() < needed) continue;
    // Some views may be occluded: the better half decides.
    const size_t half = std::max(needed, (differences.size() + 1) / 2);
    std::nth_element(differences.begin(), differences.begin() + long(half - 1), differences.end());
    float cost = 0;
    for (size_t n = 0; n < half; ++n) cost += differences[n] / float(half);
    sum += double(cost);
    ++seen;
    if (cost >= best) continue;
    best = cost;
    match.depth = depth;
  }
  match.found = seen > 1 && best < kMatch && double(best) < double(kDistinct) * sum / seen;
  return match;
}

}  // namespace

PointCloud stereo_points(const Scene& scene, FrameStore& frames,
                         const std::vector<StaticCamera>& static_cameras, size_t count,
                         uint32_t seed) {
  PointCloud points;
  const std::vector<Eye> eyes = eyes_of(scene, frames, static_cameras);
  if (eyes.size() < 2) return points;
  const Depths depths = depths_of(scene, eyes);
  // Tested pixel number n: its camera and place, and what was found there.
  struct Test {
    size_t eye = 0;
    int x = 0, y = 0;
    Match match;
  };
  constexpr size_t at_once = 1024;
  std::vector<Test> tests(at_once);
  for (size_t first = 0; first < kTries * count && points.size() < count; first += at_once) {
    for_each_parallel(at_once, num_cores(), [&](size_t k) {
      const uint n = uint(first + k);
      Test& test = tests[k] = {n % eyes.size(), 0, 0, {}};
      const Camera& camera = eyes[test.eye].camera;
      test.x = 1 + int(random_uniform(seed, streams::kStereoColumn, n) * (camera.width - 2));
      test.y = 1 + int(random_uniform(seed, streams::kStereoRow, n) * (camera.height - 2));
      if (eyes[test.eye].holds(test.x, test.y))
        test.match = match_of(eyes, test.eye, test.x, test.y, depths);
    });
    for (size_t k = 0; k < std::min(at_once, kTries * count - first); ++k) {
      const auto& [eye, x, y, match] = tests[k];
      if (!match.found || points.size() >= count) continue;
      const Eigen::Vector3d p = on_ray(eyes[eye], x + 0.5, y + 0.5, match.depth);
      for (long axis = 0; axis < 3; ++axis) points.xyz.push_back(p[axis]);
      for (int c = 0; c < 3; ++c) points.rgb.push_back(uint8_t(eyes[eye].at(x, y)[c] + 0.5f));
    }
  }
  return points;
}

}  // namespace gflow
