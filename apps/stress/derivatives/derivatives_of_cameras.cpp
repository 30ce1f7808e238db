// SPDX-License-Identifier: Apache-2.0
// Rows of the table of derivatives: gradients by the cameras of a view.
#include <Eigen/Geometry>

#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

// The world as a camera sees it that has been turned and shifted by x about its own axes.
void move_world(const PinholeCamera& c, const std::vector<double>& x, std::vector<double>& means,
                std::vector<double>& factors) {
  using Vector = Eigen::Vector3d;
  const auto world_to_camera =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(c.rotation)
          .cast<double>()
          .eval();
  const Vector translation = Eigen::Map<const Eigen::Vector3f>(c.translation).cast<double>();
  const Vector turn(x[0], x[1], x[2]), shift(x[3], x[4], x[5]);
  const Eigen::Matrix3d turned =
      turn.norm() > 0 ? Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix()
                      : Eigen::Matrix3d::Identity().eval();
  const Eigen::Matrix3d back = world_to_camera.inverse();  // floats: not quite its transpose
  for (size_t i = 0; 3 * i < means.size(); ++i) {
    Eigen::Map<Vector> mean(&means[3 * i]);
    mean = back * (turned * (world_to_camera * mean + translation) + shift - translation);
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> factor(&factors[9 * i]);
    factor = (back * turned * world_to_camera * factor).eval();
  }
}

// Gradients by both cameras of a view: rotation, translation, focal lengths.
Derivative camera_row(Queue& queue, const std::string& image, Transport transport) {
  SceneSpec spec;
  spec.n = 25;
  spec.width = 19;
  spec.height = 13;
  spec.seed = 46;
  PosedScene s = random_scene(spec);
  s.shot.settings.transport = transport;
  s.shot.camera_t2.translation[0] += 0.1f;
  for (PinholeCamera* camera : {&s.shot.camera, &s.shot.camera_t2})
    camera->fx = camera->fy = std::round(camera->fx);  // so that its multiples below are exact
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  const reference::Planes v = only(random_cotangents(s, 46, r.contributors.doubtful), image);
  const reference::Gaussians by = reference::render_vjp(s.shot, g, r, v);
  DeviceScene device(queue, s);
  device.forward();
  device.backward(v);
  const std::vector<CameraSums> sums = device.camera_gradients();
  double to_double = 0, differences = 0;
  for (const bool second : {false, true}) {
    if (second && image != "flow") continue;  // other images do not depend on it
    const PinholeCamera& camera = second ? s.shot.camera_t2 : s.shot.camera;
    const std::vector<double> expected =
        second ? reference::camera_gradient_of(camera, g.means_t2, g.factors_t2, by.means_t2,
                                               by.factors_t2)
               : reference::camera_gradient_of(camera, g.means, g.factors, by.means, by.factors);
    const CameraSums& found = sums[second];
    to_double =
        worse(to_double, relative_error(std::vector<double>(found.begin(), found.end()), expected));
    const auto loss = [&](const std::vector<double>& x) {
      reference::Gaussians moved = g;
      move_world(camera, x, second ? moved.means_t2 : moved.means,
                 second ? moved.factors_t2 : moved.factors);
      reference::Shot shot = s.shot;
      PinholeCamera& zoomed = second ? shot.camera_t2 : shot.camera;
      zoomed.fx *= float(1 + x[6]);  // exact for steps of a power of two
      zoomed.fy *= float(1 + x[7]);
      return inner(reference::render(shot, moved, &r.contributors).images, v);
    };
    const std::vector<double> slopes_found =
        slopes(loss, std::vector<double>(CAMERA_GRADIENT_SIZE), 1. / 4096);
    differences = worse(differences, relative_error(expected, slopes_found));
  }
  return {fmt::format("camera_gradient_sums, {}{}", image,
                      image == "flow" ? fmt::format(" {}", name_of(transport)) : ""),
          "rotation, translation, focal lengths",
          to_double,
          differences,
          1e-5,
          1e-6};
}

}  // namespace

std::vector<Derivative> camera_derivatives(Queue& queue) {
  std::vector<Derivative> rows;
  for (const char* image : {"rgb", "depth"})
    rows.push_back(camera_row(queue, image, Transport::paper));
  for (const Transport t :
       {Transport::paper, Transport::ot, Transport::material, Transport::translate})
    rows.push_back(camera_row(queue, "flow", t));
  return rows;
}

}  // namespace gflow::stress
