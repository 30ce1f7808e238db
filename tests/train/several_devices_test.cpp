// SPDX-License-Identifier: Apache-2.0
// Several devices that train one model end with the bits of one device. Each "device" is a queue of
// its own on the same device, in a thread of its own.
#include <gtest/gtest.h>

#include <thread>

#include "optim/train/team.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

using Bits = std::map<std::string, std::vector<uint32_t>>;

// Without what a device logs of the last view with flow that it rendered itself.
Bits bits_to_compare(Bits bits) {
  bits.erase("flow_figures");
  return bits;
}

// The state of every device after so many steps, that of the leader first.
std::vector<Bits> bits_of_team(const TrainOptions& config, size_t devices, int steps) {
  Team team(devices);
  std::vector<Bits> bits(devices);
  std::vector<std::thread> threads;
  for (size_t i = 0; i < devices; ++i)
    threads.emplace_back([&, i] {
      Seat& seat = team.seat(i);
      try {
        Queue queue = test_queue();
        SmallTraining training(queue, config);
        training.trainer.join(seat);
        seat.leads() ? training.steps(queue, steps) : training.trainer.follow(queue);
        seat.end();
        bits[i] = training.bits(queue);
      } catch (const std::exception& problem) {
        seat.fail(problem.what());
        ADD_FAILURE() << problem.what();
      }
    });
  for (std::thread& thread : threads) thread.join();
  return bits;
}

class SeveralDevices : public OnOneScene {
 protected:
  // Batches of four, density control, flow, colours of cameras, cameras that are corrected.
  TrainOptions config(const std::string& model, int steps) {
    TrainOptions config = small_config(scene(), steps);
    apply_setting(config, "motion.model=" + model);
    config.train.batch = 4;
    config.density.start = 20;
    config.density.every = 20;
    config.density.stop_fraction = 1;
    config.loss.camera_color = CameraColor::on;
    config.cameras.refine = RefineCameras::on;
    return config;
  }
  void expect_the_bits_of_one(const TrainOptions& config, const std::vector<size_t>& devices,
                              int steps) {
    const Bits one = bits_to_compare(bits_after(queue(), config, steps));
    for (const size_t n : devices)
      for (Bits& bits : bits_of_team(config, n, steps)) {
        SCOPED_TRACE(n);
        expect_equal_bits(one, bits_to_compare(std::move(bits)));
      }
  }
};

TEST_F(SeveralDevices, EndWithTheBitsOfOneForEveryMotionModel) {
  for (const char* model : names_of(MotionModelKind{})) {
    SCOPED_TRACE(model);
    expect_the_bits_of_one(config(model, 100), {2}, 100);
  }
}

TEST_F(SeveralDevices, EndWithTheBitsOfOneForAnyNumber) {
  expect_the_bits_of_one(config("spacetime", 60), {2, 3, 4}, 60);
}

TEST_F(SeveralDevices, EndWithTheBitsOfOneWithLossesOfMotionAndTheOtherDensityControl) {
  TrainOptions c = config("spacetime", 60);
  apply_setting(c, "density.strategy=mcmc");
  c.loss.rigidity = 0.1f;
  c.loss.acceleration = 0.1f;
  expect_the_bits_of_one(c, {3}, 60);
}

TEST_F(SeveralDevices, GoBackToAStateTogether) {
  const TrainOptions c = config("spacetime", 30);
  const Bits one = bits_to_compare(bits_after(queue(), c, 30));
  Team team(2);
  std::thread other([&] {
    Queue queue = test_queue();
    SmallTraining training(queue, c);
    training.trainer.join(team.seat(1));
    training.trainer.follow(queue);
    expect_equal_bits(one, bits_to_compare(training.bits(queue)));
  });
  SmallTraining training(queue(), c);
  training.trainer.join(team.seat(0));
  training.steps(queue(), 10);
  const Arrays state = training.trainer.state(queue());
  training.steps(queue(), 7);
  training.go_on(queue(), state, 10);
  training.steps(queue(), 20);
  team.seat(0).end();
  other.join();
  expect_equal_bits(one, bits_to_compare(training.bits(queue())));
}

TEST(Team, TellsTheFailureOfOneToAll) {
  Team team(3);
  std::vector<std::string> errors(2);
  std::vector<std::thread> others;
  for (size_t i : {0, 1})
    others.emplace_back([&, i] {
      try {
        team.seat(i).exchange("hello");
        team.seat(i).exchange("again");
      } catch (const Error& problem) {
        errors[i] = problem.what();
      }
      team.seat(i).end();  // nobody waits any more
    });
  EXPECT_EQ(*team.seat(2).exchange("here"), (Messages{"hello", "hello", "here"}));
  team.seat(2).fail("the disk is full");
  for (std::thread& other : others) other.join();
  EXPECT_EQ(errors, std::vector<std::string>(2, "device 2: the disk is full"));
  EXPECT_THROW(team.seat(2).exchange("more"), TrainingEnded);
}

}  // namespace
}  // namespace gflow
