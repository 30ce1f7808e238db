// SPDX-License-Identifier: Apache-2.0
#include "optim/density/hidden.hpp"

namespace gflow {

Hidden::Hidden(Queue& queue)
    : program_(queue, "density/hidden.cl"),
      hidden_see_(program_, "hidden_see"),
      hidden_fade_(program_, "hidden_fade") {}

void Hidden::begin(Queue& queue, const Parameters& parameters, bool all_views) {
  shown_.ensure(queue, parameters.count);
  shown_.fill(queue, all_views ? 0.f : -1.f);
}

void Hidden::see(Queue& queue, const Parameters& parameters, const RowList& rows,
                 const PinholeCamera& camera, const Splats& splats, const GaussianGradients& v) {
  const size_t n = rows.count_of(parameters);
  hidden_see_(queue, Range::over(n), cl_uint(n), cl_float(camera.width), cl_float(camera.height),
              rows.buffer(), splats.tiles_touched, splats.records, v.v_colors, shown_);
}

void Hidden::fade(Queue& queue, Parameters& parameters, float least, float limit) {
  const size_t n = parameters.count;
  hidden_fade_(queue, Range::over(n), cl_uint(n), least, limit, shown_,
               parameters["logit_opacities"].values);
}

}  // namespace gflow
