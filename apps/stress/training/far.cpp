// SPDX-License-Identifier: Apache-2.0
// T28: scenes up to 1e6 units from the origin of their world, read, projected on the device and
// exported.
#include "apps/stress/device_maths.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "apps/stress/training/far_scene.hpp"
#include "optim/model/renderer.hpp"
#include "optim/model/slice.hpp"

namespace gflow::stress {
namespace {

// Error of the device's projection of a distant scene against the same scene at the origin in
// double [px].
double projection_error(Queue& queue, const Scene& there, const Scene& here) {
  DeviceMaths device(queue);
  const size_t n = here.points.size();
  Floats means;
  for (const double x : there.points.xyz) means.push_back(float(x));
  std::vector<double> errors;
  for (size_t c = 0; c < here.cameras.size(); ++c) {
    const DeviceMaths::Projected found =
        device.project(pinhole(there.cameras[c], 0.01f), means, Floats(9 * n), Floats(2 * n),
                       Floats(n), Floats(6 * n));
    for (size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d expected =
          here.cameras[c].project(Eigen::Vector3d(&here.points.xyz[3 * i]));
      errors.push_back(std::hypot(double(found.means2d[2 * i]) - expected.x(),
                                  double(found.means2d[2 * i + 1]) - expected.y()));
    }
  }
  return worst(errors);
}

// Gaussians at the scene's points, exported as a PLY: position error relative to the distance from
// the origin.
double export_error(Queue& queue, const Scene& there, const Scene& here, const Place& away) {
  HostModel host;
  for (size_t i = 0; i < there.points.size(); ++i)
    append_gaussian(host, Eigen::Vector3d(&there.points.xyz[3 * i]).cast<float>(), .1f,
                    {.5f, .5f, .5f}, 0);
  host.shape.sh_degree = 0;
  host.shape.duration = 1;
  host.shape.origin = there.origin;
  set_static(host.shape, host.groups, host.count);
  Model model(queue, host);
  const ScratchFolder folder("stress");
  write_ply(folder.file("now.ply"), slice(queue, model, .5).table);
  const PointCloud now = read_point_cloud(folder.file("now.ply"));
  std::vector<double> errors;
  for (size_t i = 0; i < now.xyz.size(); ++i) {
    const double expected = here.points.xyz[i] + away[i % 3];
    errors.push_back(std::fabs(now.xyz[i] - expected) / std::fabs(away[i % 3]));
  }
  return worst(errors);
}

// The bound of the export is relative to the distance, so only distant scenes can keep it: stored
// floats span a few units around the scene's own origin.
Rows far_scenes(Queue& queue) {
  Rows rows;
  const SmallScene scene(queue);
  const Scene here = read_scene(scene.path());
  for (const double far : {1., 1e3, 1e6}) {
    const Place away = {far, -far, .7 * far};
    const FarScene moved(scene, away);
    const Scene there = read_scene(moved.path());
    rows.push_back({fmt::format("scene {:g} units away, as read: projection [px]", far),
                    projection_error(queue, there, here), 1e-3});
    if (far >= 1e6)
      rows.push_back({fmt::format("scene {:g} units away: exported positions, relative", far),
                      export_error(queue, there, here, away), 1e-9});
  }
  return rows;
}

}  // namespace

Tests far_tests() { return {{"T28", "distant scenes", true, far_scenes}}; }

}  // namespace gflow::stress
