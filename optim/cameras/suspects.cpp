// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/suspects.hpp"

#include <array>
#include <cmath>
#include <map>
#include <mutex>

#include "runtime/base/parallel.hpp"

namespace gflow {
namespace {

constexpr double kSuspect = 0.7;     // root mean square distance [px]
constexpr double kExplained = 0.35;  // below it the meeting point is a point at rest
constexpr int kMargin = 2;           // of masks [px]

using Spans = decltype(SuspectOptions::spans);
constexpr size_t kMostSights = 2 * std::tuple_size<Spans>();

// Where a pixel's flow leads in another frame.
struct Sight {
  Eigen::Matrix3d rotation;  // from the camera of the pixel to the other one
  Eigen::Vector3d shift;
  const Camera* camera;
  const TargetFlow* flow;
};

struct Meeting {
  double inverse_depth = 0;
  double distance = 0;  // [px]; 0 if fewer than two frames have flow
  size_t frames = 0;
  double parallax = 0;  // largest angle to the pixel's own ray [rad]
};

// The depth along a ray at which a point projects nearest to where flow leads, by least squares
// with weights: the equations are linear in the inverse depth w. A pixel with flow to (x, y)
// [focal lengths] has w (shift.x - x shift.z) = x a.z - a.x with a = rotation * ray, and so for y.
Meeting meeting_of(const Eigen::Vector3d& ray, size_t pixel, int x, int y,
                   const std::vector<Sight>& sights) {
  constexpr int rounds = 4;
  constexpr double knee = 400;  // [px^2] a gross error counts little more than one of 20 px
  struct Row {
    Eigen::Vector3d a, shift;
    Eigen::Vector2d to;
    double focal;
  };
  std::array<Row, kMostSights> rows;
  Meeting meeting;
  for (const Sight& sight : sights) {
    if (!sight.flow->confidence[pixel]) continue;
    const float* uv = &sight.flow->flow.uv[2 * pixel];
    const Camera& c = *sight.camera;
    rows[meeting.frames++] = {
        sight.rotation * ray,
        sight.shift,
        {(x + 0.5 + double(uv[0]) - c.cx) / c.fx, (y + 0.5 + double(uv[1]) - c.cy) / c.fy},
        c.fx};
  }
  if (meeting.frames < 2) return meeting;
  double& w = meeting.inverse_depth;
  for (int round = 0; round <= rounds; ++round) {
    double normal = 0, right = 0, cost = 0;
    for (size_t k = 0; k < meeting.frames; ++k) {
      const Row& row = rows[k];
      const double z = std::max(row.a.z() + w * row.shift.z(), 1e-3);
      const Eigen::Vector2d slope = row.shift.head<2>() - row.to * row.shift.z();
      const Eigen::Vector2d value = row.to * row.a.z() - row.a.head<2>();
      const double scale = row.focal / z;
      const double squared = (slope * w - value).squaredNorm() * scale * scale;
      cost += squared / (1 + squared / knee);
      const double weight = scale * scale / (round == 0 ? 1 : 1 + squared);
      normal += weight * slope.squaredNorm();
      right += weight * slope.dot(value);
    }
    meeting.distance = std::sqrt(cost / double(meeting.frames));
    if (round < rounds) w = normal > 0 ? std::max(right / normal, 0.0) : 0;
  }
  for (size_t k = 0; k < meeting.frames; ++k) {
    const Eigen::Vector3d seen = rows[k].a / std::max(w, 1e-9) + rows[k].shift;
    const double cosine = seen.dot(rows[k].a) / (seen.norm() * rows[k].a.norm());
    meeting.parallax = std::max(meeting.parallax, std::acos(std::clamp(cosine, -1.0, 1.0)));
  }
  return meeting;
}

using Pairs = std::map<std::pair<size_t, size_t>, std::pair<TargetFlow, TargetFlow>>;

std::vector<Sight> sights_of(const SmallVideo& video, size_t i, const Spans& spans,
                             const Pairs& pairs) {
  std::vector<Sight> sights;
  const auto add = [&](size_t j, const TargetFlow& flow) {
    const Eigen::Matrix4d between = video.cameras[j].viewmat * video.cameras[i].viewmat.inverse();
    sights.push_back(
        {between.topLeftCorner<3, 3>(), between.topRightCorner<3, 1>(), &video.cameras[j], &flow});
  };
  for (const size_t span : spans) {
    if (i >= span) add(i - span, pairs.at({i - span, i}).second);
    if (i + span < video.size()) add(i + span, pairs.at({i, i + span}).first);
  }
  return sights;
}

// The pixels of a frame that nothing at rest explains; appends every stride-th of the others.
Mask suspects_in(const SmallVideo& video, size_t i, const std::vector<Sight>& sights, size_t stride,
                 double least_parallax, PointCloud& points) {
  const Camera& camera = video.cameras[i];
  const Image& image = video.images[i];
  const Eigen::Matrix4d to_world = camera.viewmat.inverse();
  Mask mask(camera.width, camera.height);
  size_t explained = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const size_t pixel = size_t(y) * size_t(camera.width) + size_t(x);
      const Eigen::Vector3d ray((x + 0.5 - camera.cx) / camera.fx,
                                (y + 0.5 - camera.cy) / camera.fy, 1);
      const Meeting meeting = meeting_of(ray, pixel, x, y, sights);
      mask.pixels[pixel] = meeting.distance > kSuspect;
      const bool known =
          meeting.frames >= 3 && meeting.distance < kExplained && meeting.parallax > least_parallax;
      if (!known || explained++ % stride != 0) continue;
      const Eigen::Vector3d at = (to_world * (ray / meeting.inverse_depth).homogeneous()).head<3>();
      points.xyz.insert(points.xyz.end(), {at.x(), at.y(), at.z()});
      points.rgb.insert(points.rgb.end(), &image.pixels[3 * pixel], &image.pixels[3 * pixel] + 3);
    }
  return mask;
}

}  // namespace

Suspects suspects_of(const SmallVideo& video, const SuspectOptions& options,
                     const ProgressCallback& progress) {
  const Spans& spans = options.spans;
  const size_t n = video.size();
  const size_t pixels = size_t(video.width()) * size_t(video.height());
  const size_t stride = std::max<size_t>(1, n * pixels / std::max<size_t>(options.most_points, 1));
  Suspects suspects;
  Pairs pairs;
  for (size_t i = 0; i < n; ++i) {
    std::mutex mutex;
    for_each_parallel(spans.size(), num_cores(), [&](size_t k) {
      const size_t j = i + spans[k];
      if (j >= n) return;
      auto flows = quick_flows(video, i, j);
      const std::lock_guard<std::mutex> lock(mutex);
      pairs[{i, j}] = std::move(flows);
    });
    const Mask mask = suspects_in(video, i, sights_of(video, i, spans, pairs), stride,
                                  options.least_parallax, suspects.points);
    suspects.masks.push_back(options.with_margin ? with_margin(mask) : mask);
    for (const size_t span : spans)
      if (i >= span) pairs.erase({i - span, i});
    if (progress) progress(i + 1, n);
  }
  return suspects;
}

Mask with_margin(const Mask& suspects) {
  return dilated(with_share_around(suspects, 2, 0.5), kMargin);
}

}  // namespace gflow
