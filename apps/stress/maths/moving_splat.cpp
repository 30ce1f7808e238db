// SPDX-License-Identifier: Apache-2.0
#include "apps/stress/maths/moving_splat.hpp"

#include "apps/stress/errors.hpp"

namespace gflow::stress {
namespace {

constexpr double kFocal = 1000;

PinholeCamera camera() {
  PinholeCamera c{};
  for (int i = 0; i < 3; ++i) c.rotation[4 * i] = 1;
  c.fx = c.fy = float(kFocal);
  c.near_plane = 0.01f;
  c.width = c.height = 4000;  // wide enough that J is not clamped
  return c;
}

Vector2d pixel_of(const Vector3d& p) { return kFocal / p.z() * p.head<2>(); }

Floats floats(const Vector3d& v) { return {float(v.x()), float(v.y()), float(v.z())}; }
Floats floats(const Matrix3d& m) {
  Floats f;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) f.push_back(float(m(r, c)));
  return f;
}

DeviceMaths::Projected projected(DeviceMaths& device, const Pose& p) {
  return device.project(camera(), floats(p.mean), floats(p.factor), Floats(2), Floats(1),
                        Floats(6));
}

}  // namespace

FlowErrors flow_errors(DeviceMaths& device, int mode, const Pose& at_t1, const Pose& at_t2) {
  const DeviceMaths::Projected p1 = projected(device, at_t1), p2 = projected(device, at_t2);
  const Floats h = device.transport(mode, p1.m, p2.m, Floats(4)).h;
  const Vector2d mean(p1.means2d[0], p1.means2d[1]);
  const Vector2d m = Vector2d(p2.means2d[0], p2.means2d[1]) - mean;

  Eigen::Matrix<double, 2, 3> m1;
  m1 << p1.m[0], p1.m[1], p1.m[2], p1.m[3], p1.m[4], p1.m[5];
  const Eigen::Matrix2d s = m1 * m1.transpose() + double(DILATION) * Eigen::Matrix2d::Identity();
  const Whitening w = whiten({{m1(0, 0), m1(0, 1), m1(0, 2)}, {m1(1, 0), m1(1, 1), m1(1, 2)}});
  const Matrix3d precision = (at_t1.factor * at_t1.factor.transpose()).inverse();
  const Matrix3d motion = at_t2.factor * at_t1.factor.inverse();

  Random random(12);
  FlowErrors sums{0, 0, 0, std::sqrt(s.trace())};
  int count = 0;
  while (count < 4000) {
    const Vector2d z(random.normal(), random.normal());
    if (z.squaredNorm() >= 9) continue;
    ++count;
    const Vector2d x = mean + Vector2d(w.u1 * z.x() + w.u2 * z.y(), w.u3 * z.y());
    const Vector3d ray(x.x() / kFocal, x.y() / kFocal, 1);
    const Vector3d at = ray * (ray.dot(precision * at_t1.mean) / ray.dot(precision * ray));
    const Vector2d truth = pixel_of(motion * (at - at_t1.mean) + at_t2.mean) - x;
    const Vector2d flow = m + Vector2d(double(h[0]) * z.x() + double(h[1]) * z.y(),
                                       double(h[2]) * z.x() + double(h[3]) * z.y());
    sums.flow += truth.squaredNorm();
    sums.error += (flow - truth).squaredNorm();
    sums.translate += (m - truth).squaredNorm();
  }
  for (double* sum : {&sums.flow, &sums.error, &sums.translate}) *sum = std::sqrt(*sum / count);
  return sums;
}

}  // namespace gflow::stress
