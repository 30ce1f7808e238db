// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/onnx.hpp"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace gflow {
namespace {

// The reference image in [-1, 1], resized to fit the view and centred.
std::vector<float> condition_of(const NoisyView& view) {
  const GuidanceReference& reference = view.request.reference;
  const int width = view.view.camera.width, height = view.view.camera.height;
  const double scale =
      std::min(double(width) / reference.camera.width, double(height) / reference.camera.height);
  const cv::Size size(std::max(1, int(std::lround(scale * reference.camera.width))),
                      std::max(1, int(std::lround(scale * reference.camera.height))));
  const cv::Rect middle((width - size.width) / 2, (height - size.height) / 2, size.width,
                        size.height);
  const size_t pixels = size_t(width) * size_t(height);
  const size_t its_pixels = reference.rgb.size() / 3;
  std::vector<float> condition(3 * pixels);
  for (size_t c = 0; c < 3; ++c) {
    const cv::Mat plane(reference.camera.height, reference.camera.width, CV_32F,
                        const_cast<float*>(&reference.rgb[c * its_pixels]));
    cv::Mat out(height, width, CV_32F, &condition[c * pixels]);
    out.setTo(view.request.background[c]);
    cv::Mat fitted;
    cv::resize(plane, fitted, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    fitted.copyTo(out(middle));
  }
  for (float& value : condition) value = 2 * value - 1;
  return condition;
}

std::vector<float> pose_of(const GuidanceView& view) {
  const double azimuth = view.azimuth * degree;
  return {float(-view.elevation * degree), float(std::sin(azimuth)), float(std::cos(azimuth)),
          float(view.distance)};
}

}  // namespace

OnnxDenoiser::OnnxDenoiser(const std::string& path) : network_(path) {
  for (const NetworkInput& input : network_.inputs()) {
    const std::string& name = input.name;
    if (name != "sample" && name != "timestep" && name != "condition" && name != "pose")
      throw Error(fmt::format(
          "{} has an unknown input '{}'; known inputs: sample, timestep, condition, pose", path,
          name));
    if (name == "sample") sample_ = input.sizes;
  }
  if (sample_.size() != 4)
    throw Error(fmt::format("{} has no input 'sample' of four dimensions [1, 3, H, W]", path));
}

std::vector<float> OnnxDenoiser::noise(const NoisyView& view, bool condition) {
  const int width = view.view.camera.width, height = view.view.camera.height;
  if ((sample_[2] != 0 && sample_[2] != height) || (sample_[3] != 0 && sample_[3] != width))
    throw GuidanceFailed(
        fmt::format("the network {} takes images of {}x{} pixels, but the view has {}x{}: set "
                    "guidance.size = {}",
                    network_.path(), sample_[3], sample_[2], width, height, sample_[3]));
  const std::vector<int> size{1, 3, height, width};
  std::vector<NetworkValues> values;
  for (const auto& [name, sizes] : network_.inputs()) {
    if (name == "sample") values.push_back({size, view.z});
    if (name == "timestep")
      values.push_back({sizes.size() == 2 ? std::vector<int>{1, 1} : std::vector<int>{1},
                        {float(view.timestep)}});
    if (name == "condition")
      values.push_back(
          {size, condition ? condition_of(view) : std::vector<float>(view.z.size(), 0.f)});
    if (name == "pose")
      values.push_back({{1, 4}, condition ? pose_of(view.view) : std::vector<float>(4, 0.f)});
  }
  try {
    return network_.run(values);
  } catch (const NetworkFailed& problem) {
    throw GuidanceFailed(fmt::format("the network {} fails at {}x{} pixels: {}", network_.path(),
                                     width, height, problem.what()));
  }
}

}  // namespace gflow
