// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/validation.hpp"

#include <fmt/format.h>

#include "optim/eval/evaluation.hpp"
#include "optim/loss/metrics.hpp"

namespace gflow {
namespace {

constexpr size_t kViews = 8;
// [dB] below its best at which validation has worsened; a few Gaussians change it by a tenth.
constexpr double kWorse = 0.5;
// [dB] between training and validation views, and its growth since the first measurement. Rigs that
// cover their scene end with up to 4 dB.
constexpr double kGap = 6, kOpened = 2;

}  // namespace

Validation::Validation(Queue& queue, const TrainOptions& config, const LoadedScene& loaded)
    : config_(config),
      loaded_(loaded),
      val_(sample_of(loaded.scene.val, kViews)),
      train_(sample_of(loaded.scene.train, kViews)),
      renderer_(queue, engine_settings(config)) {}

double Validation::mean_psnr(Queue& queue, Model& model, const std::vector<Frame>& frames) {
  const float level = float(shown_level(config_.scene.background)) / 255;
  double sum = 0;
  for (const Frame& frame : frames) {
    const Camera& camera = loaded_.frames->camera(frame);
    Shot shot;
    shot.view.camera = pinhole(camera, near_or_default(config_.render.near, loaded_.scene));
    shot.view.camera_t2 = shot.view.camera;
    shot.time = shot.time_t2 = frame.time;
    shot.background = {level, level, level};
    renderer_.forward(queue, model, shot);
    const PlanarImage image =
        PlanarImage::from_planes(camera.width, camera.height, renderer_.images().rgb.read(queue));
    const PlanarImage truth =
        PlanarImage::from_bytes(camera.width, camera.height, loaded_.frames->rgb(frame)->pixels);
    const auto counted = loaded_.frames->counted(frame);
    const std::vector<uint8_t> mask = counted ? counted->pixels : std::vector<uint8_t>{};
    sum += psnr(color_matched(image, truth, mask), truth, mask);
  }
  return sum / double(frames.size());
}

ValidationPsnr Validation::measure(Queue& queue, Model& model) {
  return {mean_psnr(queue, model, val_), mean_psnr(queue, model, train_)};
}

std::string Validation::warning(const ValidationPsnr& now, int steps) {
  const double gap = now.train - now.val;
  if (best_steps_ == 0) first_gap_ = gap;
  if (best_steps_ == 0 || now.val > best_.val) {
    best_ = now;
    best_steps_ = steps;
  }
  if (!warned_of_gap_ && gap > kGap && gap > first_gap_ + kOpened) {
    warned_of_gap_ = true;
    return fmt::format(
        "views that are not trained reach {:.1f} dB after {} steps, trained ones {:.1f} dB: either "
        "too few cameras see each place, which depth files (loss.depth) or more cameras mend, or "
        "the poses are not exact",
        now.val, steps, now.train);
  }
  if (warned_of_worse_ || now.val > best_.val - kWorse || now.train < best_.train) return "";
  warned_of_worse_ = true;
  return fmt::format(
      "views that are not trained have become worse, from {:.1f} dB after {} steps to {:.1f} dB, "
      "while trained ones reach {:.1f} dB: the scene needs fewer steps (--iterations {}) or fewer "
      "Gaussians (density.cap)",
      best_.val, best_steps_, now.val, now.train, best_steps_);
}

}  // namespace gflow
