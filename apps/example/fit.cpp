// SPDX-License-Identifier: Apache-2.0
// Renders a moving Gaussian at two times, compares one image with a grey one, and takes ten Adam
// steps.
#include <cmath>
#include <cstdio>

#include "optim/model/renderer.hpp"

using namespace gflow;

int main() try {
  Queue queue(find_device(), {});
  HostModel host;  // one Gaussian of the spacetime model, moving to the right
  host.count = 1;
  host.shape.sh_degree = 0;
  // Groups of every motion model: log_scales are those of x, y, z and the lifetime.
  host.groups = {{"means", {0, 0, 0}},     {"means_t", {0.5f}},
                 {"quats", {1, 0, 0, 0}},  {"log_scales", {-1.5f, -1.5f, -1.5f, 5}},
                 {"logit_opacities", {2}}, {"sh0", {1, 0, -1}},
                 {"sh_rest", {}}};
  set_static(host.shape, host.groups, host.count);
  set_velocity(host.shape, host.groups, 0, {0.8, 0, 0}, std::exp(-1.5), std::exp(5));
  Model model(queue, host);
  Renderer renderer(queue, {});
  Adam adam(queue);

  Camera camera;
  camera.width = camera.height = 64;
  camera.fx = camera.fy = 64;
  camera.cx = camera.cy = 32;
  camera.viewmat(2, 3) = 3;  // the Gaussian is 3 units ahead
  Shot shot;
  shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
  shot.time = 0.25;
  shot.time_t2 = 0.75;
  shot.flow = true;

  for (int step = 0; step < 10; ++step) {
    model.begin_step(queue);
    renderer.forward(queue, model, shot);
    std::vector<float> v_rgb = renderer.images().rgb.read(queue);  // [3, H, W]
    double loss = 0;
    for (float& value : v_rgb) {
      loss += 0.5 * (value - 0.5) * (value - 0.5) / double(v_rgb.size());
      value = (value - 0.5f) / float(v_rgb.size());
    }
    ImageGradients v;
    v.zero(queue, renderer.images(), shot.flow, shot.depth);
    v.v_rgb.write(queue, v_rgb);
    renderer.backward(queue, model, v);
    model.step(queue, adam, {0.05f, 1e-8f});
    const float flow = renderer.images().flow.read(queue)[32 * 64 + 32];
    std::printf("step %d: loss %.6f, flow at the centre %.2f px\n", step, loss, double(flow));
  }
} catch (const std::exception& problem) {
  std::fprintf(stderr, "fit: %s\n", problem.what());
  return 1;
}
