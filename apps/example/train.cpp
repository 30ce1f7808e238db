// SPDX-License-Identifier: Apache-2.0
// Trains a scene folder from C++, with an observer that prints and stops early.
#include "optim/train/train.hpp"

#include <cstdio>

using namespace gflow;

struct Printer : TrainObserver {
  void on_flow(size_t done, size_t pairs) override {
    std::printf("\rflow of %zu of %zu image pairs%s", done, pairs, done < pairs ? "" : "\n");
    std::fflush(stdout);
  }
  void after_step(TrainState& state) override {
    if (state.done % 50 == 0)
      std::printf("step %d: loss %.4f, psnr %.1f dB, %zu Gaussians\n", state.done,
                  state.report().loss, state.report().value("psnr"), state.report().gaussians);
  }
  bool stop(int done) override { return done >= 200; }
};

int main(int argc, char** argv) try {
  if (argc != 3) return std::fprintf(stderr, "usage: train SCENE MODEL.ply\n"), 1;
  TrainOptions options;
  options.train.iterations = 1000;
  Queue queue(find_device(), {});
  Printer printer;
  const Scene scene = read_scene(argv[1], options.scene);
  const TrainResult result = train(queue, scene, options, {&printer, {}});
  write_model(argv[2], result.model);
  std::printf("%d steps, %s\n", result.steps, argv[2]);
} catch (const std::exception& problem) {
  std::fprintf(stderr, "train: %s\n", problem.what());
  return 1;
}
