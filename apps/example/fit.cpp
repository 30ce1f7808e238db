// SPDX-License-Identifier: Apache-2.0
// Renders a moving Gaussian at two times, compares one image with a grey one, and takes ten Adam
// steps.
#include <cstdio>

#include "optim/model/renderer.hpp"

using namespace gflow;

int main() {
  Queue queue(find_device(), {});
  HostModel host;  // one Gaussian of the spacetime model, moving to the right
  host.count = 1;
  host.shape.sh_degree = 0;
  host.groups = {{"means", {0, 0, 0}},
                 {"means_t", {0.5f}},
                 {"quats", {1, 0, 0, 0}},
                 {"velocities", {0.8f, 0, 0}},
                 {"log_scales", {-1.5f, -1.5f, -1.5f, 5}},
                 {"half_accelerations", {0, 0, 0}},
                 {"turns", {0, 0, 0, 0}},
                 {"logit_opacities", {2}},
                 {"sh0", {1, 0, -1}},
                 {"sh_rest", {}}};
  Model model(queue, host);
  Renderer renderer(queue, {});
  Adam adam(queue, {});

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
    Parameters& p = model.parameters;
    p.forget_seen(queue);
    renderer.forward(queue, model, shot);
    const std::vector<float> rgb = renderer.images().rgb.read(queue);  // [3, H, W]
    std::vector<float> v_rgb(rgb.size());
    double loss = 0;
    for (size_t i = 0; i < rgb.size(); ++i) {
      loss += 0.5 * (rgb[i] - 0.5) * (rgb[i] - 0.5) / double(rgb.size());
      v_rgb[i] = (rgb[i] - 0.5f) / float(rgb.size());
    }
    ImageGradients v;
    v.v_rgb = Buffer<float>(queue, v_rgb, "v_rgb");
    v.v_alpha = Buffer<float>(queue, std::vector<float>(rgb.size() / 3), "v_alpha");
    v.v_flow = Buffer<float>(queue, std::vector<float>(2 * rgb.size() / 3), "v_flow");
    renderer.backward(queue, model, v);
    adam.advance(queue, p.rows, p.active);
    for (size_t g = 0; g < p.groups.size(); ++g)
      adam.step(queue, p.groups[g], p.rows, p.active_in(p.specs[g]), {0.05f, 1e-8f});
    const float flow = renderer.images().flow.read(queue)[32 * 64 + 32];
    std::printf("step %d: loss %.6f, flow at the centre %.2f px\n", step, loss, double(flow));
  }
}
