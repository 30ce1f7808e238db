// SPDX-License-Identifier: Apache-2.0
// Training sorts the rows at its first step and after each round of density control.
#include <gtest/gtest.h>

#include <cmath>

#include "optim/density/order.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

struct Rows {
  std::vector<float> means, means_t, log_scales;
};

Rows rows_of(Queue& queue, const Parameters& p) {
  return {p["means"].values.read(queue), p["means_t"].values.read(queue),
          p["log_scales"].values.read(queue)};
}

std::vector<uint32_t> order_of(const Rows& rows, const Model& model) {
  return gflow::order_of(rows.means, rows.means_t, rows.log_scales, model.shape.duration);
}

size_t out_of_place(const std::vector<uint32_t>& order) {
  size_t count = 0;
  for (size_t j = 0; j < order.size(); ++j) count += order[j] != j;
  return count;
}

TEST(RowOrderInTraining, IsThatOfTimeAndPlaceFromTheFirstStepOn) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainOptions config = small_config(scene, 40);
  config.density.enabled = false;
  // Almost no learning, so that the position of a Gaussian identifies it.
  config.lr.means = config.lr.means_final = config.lr.mean_t = config.lr.scales = 1e-12f;
  SmallTraining training(queue, config);
  const Rows before = rows_of(queue, training.model.parameters);
  const std::vector<uint32_t> order = order_of(before, training.model);
  ASSERT_GT(out_of_place(order), order.size() / 2);
  training.steps(queue, 1);
  const Rows after = rows_of(queue, training.model.parameters);
  for (size_t j = 0; j < order.size(); ++j)
    for (size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(after.means[3 * j + axis], before.means[3 * order[j] + axis], 1e-6) << j;
}

TEST(RowOrderInTraining, IsMadeAgainAfterDensityControl) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  SmallTraining training(queue, small_config(scene, 500));
  training.steps(queue, 100);  // the first round, which removes superfluous Gaussians
  const size_t count = training.model.parameters.count;
  training.steps(queue, 50);
  ASSERT_GT(training.model.parameters.count, count);
  EXPECT_EQ(out_of_place(order_of(rows_of(queue, training.model.parameters), training.model)), 0u);
}

}  // namespace
}  // namespace gflow
