// SPDX-License-Identifier: Apache-2.0
#include "optim/density/near_fade.hpp"

namespace gflow {

NearFade::NearFade(Queue& queue)
    : program_(queue, "density/near.cl"), near_fade_(program_, "near_fade") {}

void NearFade::run(Queue& queue, Parameters& parameters, Motion& motion, float t,
                   const std::vector<PinholeCamera>& cameras, float most_logit) {
  std::vector<float> views;
  for (const PinholeCamera& c : cameras) {
    for (int row = 0; row < 3; ++row)
      views.insert(views.end(), {c.rotation[3 * row], c.rotation[3 * row + 1],
                                 c.rotation[3 * row + 2], c.translation[row]});
    views.insert(views.end(), {c.fx, c.fy, c.cx, c.cy, float(c.width), float(c.height)});
  }
  if (cameras.empty() || parameters.count == 0) return;
  views_.ensure(queue, views.size());
  views_.write(queue, views);
  motion.at(queue, parameters, t, nullptr, at_);
  near_fade_(queue, Range::over(parameters.count), cl_uint(parameters.count),
             cl_uint(cameras.size()), cameras[0].near_plane, most_logit, views_, at_.means,
             at_.opacities, parameters["logit_opacities"].values);
}

}  // namespace gflow
