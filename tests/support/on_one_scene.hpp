// SPDX-License-Identifier: Apache-2.0
// Trainings of one small scene, rendered once per test suite, and their bits.
#pragma once
#include "optim/train/trainer.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {

class OnOneScene : public testing::Test {
 protected:
  static void SetUpTestSuite() { made_ = new Made; }
  static void TearDownTestSuite() {
    delete made_;
    made_ = nullptr;
  }
  Queue& queue() { return made_->queue; }
  const SmallScene& scene() { return made_->scene; }

 private:
  struct Made {
    Queue queue = test_queue();
    SmallScene scene{queue};
  };
  inline static Made* made_ = nullptr;
};

inline std::map<std::string, std::vector<uint32_t>> bits_after(Queue& queue,
                                                               const TrainOptions& config,
                                                               int steps) {
  SmallTraining training(queue, config);
  training.steps(queue, steps);
  return training.bits(queue);
}

inline void expect_equal_bits(const std::map<std::string, std::vector<uint32_t>>& a,
                              const std::map<std::string, std::vector<uint32_t>>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [name, values] : a) EXPECT_TRUE(values == b.at(name)) << name;
}

}  // namespace gflow
