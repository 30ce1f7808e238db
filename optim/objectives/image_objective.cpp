// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/image_objective.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "optim/objectives/crop.hpp"

namespace gflow {

// Several cameras that stand still. Images of one camera that walks have maps of their own, too, if
// its exposure is automatic; but test images lie between them and are more like their neighbours
// than like the mean.
bool have_own_colors(CameraColor choice, const Scene& scene) {
  if (choice != CameraColor::automatic) return choice == CameraColor::on;
  std::set<int> cameras;
  for (const Frame& frame : scene.train) cameras.insert(frame.camera);
  const bool still = is_rig(scene.layout) || scene.train.size() >= 2 * cameras.size();
  return still && cameras.size() >= 3;
}

ImageObjective::ImageObjective(Queue& queue, const Scene& scene, FrameStore& frames, float ssim,
                               float foreground, const std::optional<CameraColorRule>& colors)
    : frames_(frames), loss_(queue, ssim), foreground_weight_(foreground) {
  if (!colors) return;
  for (const Frame& frame : scene.train) color_rows_.emplace(frame.camera, color_rows_.size());
  colors_ = std::make_unique<CameraColors>(queue, color_rows_.size(), *colors);
}

// The frame store composites images on its own background; the step may use another one.
void ImageObjective::read_truth(const ViewContext& view) {
  const Frame& frame = *view.sample.frame;
  const Rect& part = view.sample.part;
  const bool as_stored = view.background == frames_.background();
  const auto image = as_stored ? frames_.rgb(frame) : frames_.image(frame);
  crop(image->pixels, view.width, image->channels, part, truth_bytes_);
  if (image->channels == 4)
    truth_bytes_ =
        over_background({part.width, part.height, 4, std::move(truth_bytes_)}, view.background)
            .pixels;
}

void ImageObjective::read_counted(const ViewContext& view) {
  counted_bytes_.clear();
  if (const auto counted = frames_.counted(*view.sample.frame))
    crop(counted->pixels, view.width, 1, view.sample.part, counted_bytes_);
}

// Binning of this view has waited for the queue, so the host arrays of earlier uploads are free.
void ImageObjective::add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                                   ImageGradients& v) {
  read_truth(view);
  read_counted(view);
  const Rect& part = view.sample.part;
  const Buffer<float>& rgb = renderer.images().rgb;
  truth_.ensure(queue, truth_bytes_.size());
  truth_.write_async(queue, truth_bytes_);
  const size_t pixels = size_t(part.width) * size_t(part.height);
  const size_t row = colors_ ? color_rows_.at(view.sample.frame->camera) : 0;
  shown_ = colors_ ? &colors_->show(queue, row, pixels, rgb) : &rgb;
  const bool some_ignored = !counted_bytes_.empty();
  if (some_ignored) {
    if (!weights_) weights_ = std::make_unique<PixelWeights>(queue);
    counted_.ensure(queue, pixels);
    counted_.write_async(queue, counted_bytes_);
    weights_->fill_truth(queue, pixels, counted_, *shown_, truth_);
  }
  loss_.run(queue, part.width, part.height, *shown_, truth_, v.v_rgb, view.share);
  if (some_ignored) weights_->scale_gradient(queue, pixels, counted_, 0, 1, v.v_rgb);
  weigh_foreground(queue, view, v.v_rgb);
  if (!colors_) return;
  colors_->backward(queue, row, pixels, rgb, v.v_rgb);
}

std::vector<float> ImageObjective::take_view(Queue& queue, const ViewContext&) {
  return colors_ ? colors_->take_visit(queue) : std::vector<float>{};
}

void ImageObjective::give_view(Queue& queue, const ViewContext& view,
                               const std::vector<float>& visit) {
  if (colors_) colors_->add_visit(queue, color_rows_.at(view.sample.frame->camera), visit);
}

void ImageObjective::end_step(Queue& queue, const StepContext&) {
  if (colors_) colors_->step(queue);
}

void ImageObjective::weigh_foreground(Queue& queue, const ViewContext& view, Buffer<float>& v_rgb) {
  const auto mask = foreground_weight_ == 1 ? nullptr : frames_.foreground(*view.sample.frame);
  if (!mask) return;
  if (!weights_) weights_ = std::make_unique<PixelWeights>(queue);
  const auto white = std::count(mask->pixels.begin(), mask->pixels.end(), 255);
  const float share = float(white) / float(mask->pixels.size());
  const float mean = 1 + (foreground_weight_ - 1) * share;
  crop(mask->pixels, view.width, 1, view.sample.part, foreground_bytes_);
  foreground_.ensure(queue, foreground_bytes_.size());
  foreground_.write_async(queue, foreground_bytes_);
  weights_->scale_gradient(queue, foreground_bytes_.size(), foreground_, 1 / mean,
                           foreground_weight_ / mean, v_rgb);
}

void ImageObjective::report(Queue& queue, const Renderer&, LossReport& report) {
  const ImageLossValue value = loss_.value(queue);
  const std::vector<float> rgb = shown_->read(queue);
  const size_t pixels = rgb.size() / 3;
  double sum = 0;
  size_t values = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < pixels; ++i) {
      if (!counted_bytes_.empty() && counted_bytes_[i] == 0) continue;
      ++values;
      const double d =
          std::clamp(double(rgb[c * pixels + i]), 0.0, 1.0) - truth_bytes_[3 * i + c] / 255.0;
      sum += d * d;
    }
  const double psnr = -10 * std::log10(std::max(sum / double(std::max<size_t>(values, 1)), 1e-12));
  report.loss += value.total;
  report.terms.push_back({"l1", value.l1, fmt::format("L1 {:.4f}", value.l1)});
  report.terms.push_back({"ssim", value.ssim, ""});
  report.terms.push_back({"psnr", psnr, fmt::format("psnr {:.1f}", psnr)});
}

void ImageObjective::save_state(Queue& queue, Arrays& arrays) {
  if (colors_) colors_->save_state(queue, arrays);
}

void ImageObjective::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  // Checkpoints of an older gflow have none: cameras begin alike.
  if (colors_ && arrays.count("camera_colors/values")) colors_->load_state(queue, arrays, path);
}

}  // namespace gflow
