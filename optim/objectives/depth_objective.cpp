// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/depth_objective.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "optim/objectives/crop.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/depths.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

constexpr int kReportsWithoutFit = 10;
constexpr size_t kCacheBytes = size_t{256} << 20;

// Zero is no surface in a depth map, and infinitely far in a map of disparity.
void remove_unknown(std::vector<float>& depth, DepthFiles files) {
  for (float& value : depth)
    if (!std::isfinite(value) || (files != DepthFiles::disparity && !(value > 0)))
      value = std::nanf("");
}

float median(std::vector<float> values) {
  const auto middle = values.begin() + long(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// To median 0 and median deviation 1, whatever outliers there are.
void standardise(std::vector<float>& values) {
  std::vector<float> known;
  for (const float x : values)
    if (!std::isnan(x)) known.push_back(x);
  if (known.empty()) return;
  const float middle = median(known);
  for (float& x : known) x = std::fabs(x - middle);
  double deviation = double(median(known));
  if (!(deviation > 0))  // half of the values are one
    for (const float x : known) deviation += double(x) / double(known.size());
  for (float& x : values) x = float((double(x) - double(middle)) / (deviation > 0 ? deviation : 1));
}

std::map<std::string, size_t> images_with_depth(const Scene& scene) {
  std::map<std::string, size_t> images;
  for (const Frame& frame : scene.train)
    if (!frame.depth_path.empty()) images.emplace(frame.depth_path, images.size());
  return images;
}

bool says_nothing(const std::vector<float>& known, DepthFiles files) {
  if (known.empty()) return true;
  const auto [least, most] = std::minmax_element(known.begin(), known.end());
  return files != DepthFiles::metric && *least == *most;
}

}  // namespace

void require_depth(const TrainOptions& options, const Scene& scene, const FrameStore& frames) {
  if (!(options.loss.depth > 0)) return;
  std::vector<const Frame*> with_depth;
  for (const Frame& frame : scene.train)
    if (!frame.depth_path.empty()) with_depth.push_back(&frame);
  if (with_depth.empty())
    throw Error(
        fmt::format("loss.depth is {:g}, but no training image of scene '{}' has a depth file: put "
                    "them into depth/, named like the images (.npy or .png), or name them by "
                    "'depth_file_path' (nerfstudio)",
                    options.loss.depth, scene.name));
  constexpr size_t most = 100;  // files to look into
  const size_t stride = (with_depth.size() + most - 1) / most;
  std::vector<float> ratios;  // of their depth to that of points
  size_t useless = 0, checked = 0;
  std::string one;
  for (size_t i = 0; i < with_depth.size(); i += stride, ++checked) {
    const Frame& frame = *with_depth[i];
    const Camera& camera = frames.camera(frame);
    std::vector<float> known = read_depth_map(frame, scene.cameras[size_t(frame.camera)],
                                              camera.width, camera.height, options.scene);
    remove_unknown(known, options.scene.depth);
    known.erase(std::remove_if(known.begin(), known.end(), [](float x) { return std::isnan(x); }),
                known.end());
    if (says_nothing(known, options.scene.depth)) {
      if (useless++ == 0) one = frame.depth_path;
    } else if (const double depth = median_depth_of_points(scene, frame.camera); depth > 0) {
      ratios.push_back(median(known) / float(depth));
    }
  }
  if (useless > 0)
    warn(
        fmt::format("{} of {} depth files have no depth or one value everywhere and train "
                    "nothing, such as {}",
                    useless, checked, one));
  if (options.scene.depth != DepthFiles::metric || ratios.empty()) return;
  if (const float ratio = median(ratios); ratio > 3 || ratio < 1 / 3.f)
    warn(fmt::format(
        "the depth files of scene '{}' are {:.3g} times as deep as its points: if their "
        "unit is not that of the cameras, set scene.depth_unit (integers) or "
        "scene.depth=scaled",
        scene.name, ratio));
}

DepthObjective::DepthObjective(Queue& queue, const TrainOptions& options, const Scene& scene,
                               FrameStore& frames)
    : options_(options),
      scene_(scene),
      frames_(frames),
      cache_(kCacheBytes),
      images_(images_with_depth(scene)),
      loss_(queue, fit_of(options.scene.depth), options.loss.depth_knee, images_.size()),
      whole_fits_(images_.size(), 0) {}

DepthFit DepthObjective::fit_of(DepthFiles files) {
  if (files == DepthFiles::metric) return DepthFit::none;
  return files == DepthFiles::scaled ? DepthFit::depth : DepthFit::disparity;
}

DepthObjective::DepthMap DepthObjective::load(const Frame& frame) const {
  const Camera& camera = frames_.camera(frame);
  DepthMap depth = read_depth_map(frame, scene_.cameras[size_t(frame.camera)], camera.width,
                                  camera.height, options_.scene);
  if (const auto counted = frames_.counted(frame))
    for (size_t i = 0; i < depth.size(); ++i)
      if (!counted->pixels[i]) depth[i] = std::nanf("");
  remove_unknown(depth, options_.scene.depth);
  if (options_.scene.depth != DepthFiles::metric) standardise(depth);
  return depth;
}

void DepthObjective::request(Queue& queue, const ViewContext& view, Shot& shot) {
  const Frame& frame = *view.sample.frame;
  has_depth_ = !frame.depth_path.empty();
  if (!has_depth_) return;
  shot.depth = true;
  const auto depth = cache_.get(
      frame.depth_path, [&] { return load(frame); },
      [](const DepthMap& map) { return map.size() * sizeof(float); });
  crop(*depth, view.width, 1, view.sample.part, part_);
  file_.ensure(queue, part_.size());
  file_.write_async(queue, part_);
}

void DepthObjective::add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                                   ImageGradients& v) {
  if (!has_depth_) return;
  const Images& images = renderer.images();
  const size_t image = images_.at(view.sample.frame->depth_path), pixels = part_.size();
  const bool whole = view.share == 1;
  if (whole || !whole_fits_[image])
    loss_.fit(queue, image, pixels, images.depth, images.alpha, file_);
  whole_fits_[image] |= whole;
  loss_.run(queue, options_.loss.depth * view.share, image, pixels, images.depth, images.alpha,
            file_, v.v_depth, v.v_alpha);
  is_new_ = true;
}

std::vector<float> DepthObjective::take_view(Queue& queue, const ViewContext& view) {
  const auto image = images_.find(view.sample.frame->depth_path);
  if (image == images_.end()) return {};
  std::vector<float> fit = loss_.fits().read_range(queue, 4 * image->second, 4);
  fit.push_back(whole_fits_[image->second]);
  return fit;
}

void DepthObjective::give_view(Queue& queue, const ViewContext& view,
                               const std::vector<float>& fit) {
  const auto image = images_.find(view.sample.frame->depth_path);
  if (image == images_.end()) return;
  loss_.fits().write_range(queue, 4 * image->second, {fit.begin(), fit.begin() + 4});
  whole_fits_[image->second] = fit[4] > 0;
}

DepthLossValue DepthObjective::value(Queue& queue) {
  if (is_new_) value_ = loss_.value(queue);
  is_new_ = false;
  return value_;
}

void DepthObjective::report(Queue& queue, const Renderer&, LossReport& report) {
  const DepthLossValue last = value(queue);
  warn_of_no_fit(last);
  if (has_depth_) report.loss += last.loss;
  report.terms.push_back({"depth_loss", last.loss, ""});
  report.terms.push_back(
      {"depth_error", last.error, fmt::format("depth {:.1f} %", 100 * last.error)});
}

// Files of depth read as disparity, or the reverse, have no fit with a scale above 0.
void DepthObjective::warn_of_no_fit(const DepthLossValue& last) {
  const DepthFiles files = options_.scene.depth;
  if (!has_depth_ || files == DepthFiles::metric) return;
  unfitted_ = last.pixels > 0 ? 0 : unfitted_ + 1;
  if (unfitted_ != kReportsWithoutFit) return;
  const bool disparity = files == DepthFiles::disparity;
  warn(
      fmt::format("the depth files of scene '{}' train nothing: no scale and shift fits them to "
                  "what is rendered; scene.depth = {} means that values are larger where things "
                  "are {}: is it {}?",
                  scene_.name, name_of(files), disparity ? "nearer" : "farther",
                  disparity ? "scaled" : "disparity"));
}

// The values are needed for the log of a step without depth.
void DepthObjective::save_state(Queue& queue, Arrays& arrays) {
  const DepthLossValue last = value(queue);
  arrays["depth_loss/last"] = {{2}, std::vector<float>{float(last.loss), float(last.error)}};
  arrays["depth_loss/fits"] = {{images_.size(), 4}, loss_.fits().read(queue)};
  arrays["depth_loss/whole_fits"] = {{images_.size()}, whole_fits_};
}

void DepthObjective::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  is_new_ = false;
  value_ = {};
  if (!arrays.count("depth_loss/last")) return;
  const std::vector<float>& last = exact_values<float>(arrays, "depth_loss/last", {2}, path);
  value_ = {double(last[0]), double(last[1]), 0};
  loss_.fits().write(queue,
                     exact_values<float>(arrays, "depth_loss/fits", {images_.size(), 4}, path));
  whole_fits_ = exact_values<uint8_t>(arrays, "depth_loss/whole_fits", {images_.size()}, path);
}

}  // namespace gflow
