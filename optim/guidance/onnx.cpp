// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/onnx.hpp"

#include <fmt/format.h>

#include <cmath>

#include "optim/guidance/onnx_inputs.hpp"

#ifdef GFLOW_WITH_DNN
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace gflow {

#ifdef GFLOW_WITH_DNN

struct OnnxDenoiser::Net {
  cv::dnn::Net net;
};

namespace {

constexpr double degree = M_PI / 180;

// OpenCV's own words, without its place in the source.
std::string words_of(const cv::Exception& problem) {
  std::string text = problem.err.empty() ? problem.what() : problem.err;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  return text;
}

cv::Mat blob(const std::vector<int>& sizes, const std::vector<float>& values) {
  cv::Mat mat(sizes, CV_32F);
  std::copy(values.begin(), values.end(), mat.ptr<float>());
  return mat;
}

// The reference picture in [-1, 1], shrunk to fit into the view's size and put in its middle.
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

OnnxDenoiser::OnnxDenoiser(const std::string& path) : path_(path), inputs_(onnx_inputs(path)) {
  for (const auto& [name, sizes] : inputs_)
    if (name != "sample" && name != "timestep" && name != "condition" && name != "pose")
      throw Error(fmt::format("{} has an input '{}'; gflow gives sample, timestep, condition, pose",
                              path, name));
  const auto sample = inputs_.find("sample");
  if (sample == inputs_.end() || sample->second.size() != 4)
    throw Error(fmt::format("{} has no input 'sample' of four dimensions [1, 3, H, W]", path));
  try {
    net_ = std::make_unique<Net>(Net{cv::dnn::readNetFromONNX(path)});
  } catch (const cv::Exception& problem) {
    throw Error(fmt::format("OpenCV cannot run the network {}: {}", path, words_of(problem)));
  }
}

std::vector<float> OnnxDenoiser::noise(const NoisyView& view, bool condition) {
  const int width = view.view.camera.width, height = view.view.camera.height;
  const std::vector<int64_t>& wanted = inputs_.at("sample");
  if ((wanted[2] != 0 && wanted[2] != height) || (wanted[3] != 0 && wanted[3] != width))
    throw GuidanceFailed(
        fmt::format("the network {} takes pictures of {}x{} pixels, the view has {}x{}: set "
                    "guidance.size = {}",
                    path_, wanted[3], wanted[2], width, height, wanted[3]));
  const std::vector<int> size{1, 3, height, width};
  try {
    for (const auto& [name, sizes] : inputs_) {
      if (name == "sample") net_->net.setInput(blob(size, view.z), name);
      if (name == "timestep")
        net_->net.setInput(blob(sizes.size() == 2 ? std::vector<int>{1, 1} : std::vector<int>{1},
                                {float(view.timestep)}),
                           name);
      if (name == "condition")
        net_->net.setInput(
            blob(size, condition ? condition_of(view) : std::vector<float>(view.z.size(), 0.f)),
            name);
      if (name == "pose")
        net_->net.setInput(
            blob({1, 4}, condition ? pose_of(view.view) : std::vector<float>(4, 0.f)), name);
    }
    const cv::Mat out = net_->net.forward();
    return {out.begin<float>(), out.end<float>()};
  } catch (const cv::Exception& problem) {
    throw GuidanceFailed(fmt::format("the network {} fails at {}x{} pixels: {}", path_, width,
                                     height, words_of(problem)));
  }
}

#else

struct OnnxDenoiser::Net {};

OnnxDenoiser::OnnxDenoiser(const std::string& path) : path_(path) {
  throw Error(
      fmt::format("the network {} needs OpenCV's dnn module, without which this gflow was "
                  "built: install libopencv-dnn-dev and build again",
                  path));
}
std::vector<float> OnnxDenoiser::noise(const NoisyView&, bool) { return {}; }

#endif

OnnxDenoiser::~OnnxDenoiser() = default;

}  // namespace gflow
