// SPDX-License-Identifier: Apache-2.0
// T20: the robust norm of the flow loss where squares under- and overflow, and at its knee.
#include "shared/loss.h"

#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/loss/flow_loss.hpp"

namespace gflow::stress {
namespace {

constexpr float kKnee = 1e-3f;

struct Found {
  std::vector<float> v_flow;
  double loss;
};

// One pixel with a flow error of (r, 0); weight 1.
Found at(Queue& queue, FlowLoss& loss, float r) {
  const Buffer<float> flow(queue, {r, 0.f}, "flow"), target_flow(queue, {0.f, 0.f}, "teacher");
  const Buffer<float> alpha(queue, {1.f}, "alpha");
  const Buffer<cl_uchar> confidence(queue, {cl_uchar(255)}, "confidence");
  Buffer<float> v(queue, 2, "v_flow");
  loss.run(queue, 1, 1, 1, flow, alpha, target_flow, confidence, v);
  return {v.read(queue), loss.value(queue).loss};
}

Rows norms(Queue& queue) {
  Rows rows;
  FlowLoss loss(queue, kKnee);
  const Found zero = at(queue, loss, 0);
  rows.push_back(
      {"r = 0: loss and gradient", std::fabs(zero.loss) + std::fabs(double(zero.v_flow[0])), 0});
  for (const float r : {1e-25f, 1e-19f, 1e-10f, 1e-3f, 1.f, 1e5f, 3e19f}) {
    const Found found = at(queue, loss, r);
    const double expected = double(r) / std::hypot(double(r), double(kKnee));
    rows.push_back({fmt::format("r = {:.0e}, gradient, relative", r),
                    std::fabs(double(found.v_flow[0]) / expected - 1), 1e-6});
    const double loss =
        double(r) * double(r) / (std::hypot(double(r), double(kKnee)) + double(kKnee));
    constexpr double least = std::numeric_limits<float>::min();
    if (loss < least)  // below the normal range of float: compare absolutely
      rows.push_back({fmt::format("r = {:.0e}, loss, vs double {:.0e}", r, loss),
                      std::fabs(found.loss - loss), least});
    else
      rows.push_back(
          {fmt::format("r = {:.0e}, loss, relative", r), std::fabs(found.loss / loss - 1), 1e-6});
  }
  // The slope is continuous at the knee; the two points differ by about 1e-10 px.
  const double below = double(at(queue, loss, std::nextafter(kKnee, 0.f)).v_flow[0]);
  const double above = double(at(queue, loss, std::nextafter(kKnee, 1.f)).v_flow[0]);
  rows.push_back({"jump of the slope at the knee", std::fabs(above - below), 1e-6});
  return rows;
}

}  // namespace

Tests loss_tests() { return {{"T20", "robust norm", true, norms}}; }

}  // namespace gflow::stress
