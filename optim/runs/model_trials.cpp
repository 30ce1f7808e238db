// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/model_trials.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/eval/validation.hpp"
#include "optim/init/init.hpp"
#include "optim/scene/held_back.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/train_loop.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr int kHeldBack = 8;    // of so many views one is held back
constexpr double kClear = 0.3;  // [dB] by which another model must be better: other views and seeds
                                // differ as much

// Mean PSNR of the held-back views after a short training.
double psnr_of_trial(Queue& queue, const Scene& scene, const TrainOptions& config,
                     const ScratchFolder& folder, bool quiet) {
  Preparation prepared(config, with_frames(scene, config.scene, folder.file("frames")));
  prepared.find_motion_masks();
  prepared.compute_flow(folder.file("flow"), true);
  Model model(queue, prepared.first_model(queue, true));
  Trainer trainer = prepared.trainer(queue, model);
  Progress progress(fmt::format("trial of {}", name_of(model.shape.motion)),
                    config.train.iterations, quiet);
  StepCounter counter(progress_callback(progress), size_t(config.train.iterations));
  train_loop(queue, trainer, 0, config.train.iterations, counter);
  prepared.flows().prefetch({});
  progress.finish();
  return Validation(queue, config, prepared.loaded()).measure(queue, model).val;
}

}  // namespace

bool chooses_by_trials(const TrainOptions& config) {
  return config.motion.model == MotionChoice::automatic && config.motion.trial_steps > 0;
}

MotionModelKind best_of_trials(const std::map<MotionModelKind, double>& psnr,
                               MotionModelKind suggested) {
  const auto weighed = [&](const auto& trial) {
    return trial.second + (trial.first == suggested ? kClear : 0);
  };
  return std::max_element(psnr.begin(), psnr.end(),
                          [&](const auto& a, const auto& b) { return weighed(a) < weighed(b); })
      ->first;
}

MotionChoice model_by_trials(Queue& queue, const TrainOptions& options, bool quiet) {
  Scene scene = read_scene(options.scene.path, options.scene);
  const MotionModelKind suggested = motion_model(scene, options);
  if (scene.steps < 2) return choice_of(suggested);
  scene.val.clear();
  hold_back(scene, kHeldBack);
  TrainOptions config = options;
  config.train.iterations = std::min(options.train.iterations, options.motion.trial_steps);
  config.train.minutes = 0;
  const ScratchFolder folder("trials");
  std::map<MotionModelKind, double> results;
  for (const MotionModelKind kind : {MotionModelKind::spacetime, MotionModelKind::keyframes,
                                     MotionModelKind::hexplane, MotionModelKind::nodes}) {
    config.motion.model = choice_of(kind);
    const double psnr = psnr_of_trial(queue, scene, config, folder, quiet);
    results[kind] = psnr;
    if (!quiet)
      print_status("trial of {}: PSNR {:.2f} dB of views that are held back\n", name_of(kind),
                   psnr);
  }
  const MotionModelKind chosen = best_of_trials(results, suggested);
  if (!quiet)
    print_status("chosen: {}{}\n", name_of(chosen),
                 chosen == suggested
                     ? fmt::format(", for this kind of scene; no other is {} dB better", kClear)
                     : "");
  return choice_of(chosen);
}

}  // namespace gflow
