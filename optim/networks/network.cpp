// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/network.hpp"

#include <fmt/format.h>

#include <algorithm>

#ifdef GFLOW_WITH_DNN
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#endif

namespace gflow {

#ifdef GFLOW_WITH_DNN

struct Network::State {
  cv::dnn::Net net;
};

namespace {

// OpenCV's words in one line, without its place in the source.
std::string words_of(const cv::Exception& problem) {
  std::string text = problem.err.empty() ? problem.what() : problem.err;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// While it lives OpenCV does not also write to stderr what it throws.
class Quiet {
 public:
  Quiet() = default;
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;
  ~Quiet() { cv::utils::logging::setLogLevel(before_); }

 private:
  cv::utils::logging::LogLevel before_ =
      cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
};

cv::Mat blob(const NetworkValues& given) {
  cv::Mat mat(given.shape, CV_32F);
  std::copy(given.values.begin(), given.values.end(), mat.ptr<float>());
  return mat;
}

}  // namespace

Network::Network(const std::string& path) : path_(path), inputs_(onnx_input_list(path)) {
  const Quiet quiet;
  try {
    state_ = std::make_unique<State>(State{cv::dnn::readNetFromONNX(path)});
  } catch (const cv::Exception& problem) {
    throw Error(fmt::format("OpenCV cannot run the network {}: {}", path, words_of(problem)));
  }
}

std::vector<float> Network::run(const std::vector<NetworkValues>& values) {
  const Quiet quiet;
  try {
    for (size_t i = 0; i < inputs_.size(); ++i)
      state_->net.setInput(blob(values.at(i)), inputs_[i].name);
    const cv::Mat out = state_->net.forward();
    return {out.begin<float>(), out.end<float>()};
  } catch (const cv::Exception& problem) {
    throw NetworkFailed(words_of(problem));
  }
}

#else

struct Network::State {};

Network::Network(const std::string& path) : path_(path) {
  throw Error(
      fmt::format("the network {} needs OpenCV's dnn module, without which this gflow was "
                  "built: install libopencv-dnn-dev and build again",
                  path));
}
std::vector<float> Network::run(const std::vector<NetworkValues>&) { return {}; }

#endif

Network::~Network() = default;
Network::Network(Network&&) noexcept = default;
Network& Network::operator=(Network&&) noexcept = default;

}  // namespace gflow
