// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/network.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>

#ifdef GFLOW_WITH_DNN
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "optim/images/opencv_threads.hpp"
#include "optim/networks/trial.hpp"
#endif

namespace gflow {

#ifdef GFLOW_WITH_DNN

struct Network::State {
  cv::dnn::Net net;
};

namespace {

// OpenCV's message in one line, without its line prefixes.
std::string words_of(const cv::Exception& problem) {
  std::string text = problem.err.empty() ? problem.what() : problem.err;
  while (!text.empty() && std::strchr("\n >", text.back())) text.pop_back();
  while (!text.empty() && std::strchr("\n >", text.front())) text.erase(0, 1);
  for (size_t at = 0; (at = text.find("\n> ", at)) != text.npos;) text.replace(at, 3, " ");
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// Silences OpenCV's log while it exists: OpenCV also prints what it throws.
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

// Runs `work`; rethrows exceptions of OpenCV and protobuf as make(message).
template <class Make>
void with_their_words(const std::function<void()>& work, Make make) {
  try {
    work();
  } catch (const cv::Exception& problem) {
    throw make(words_of(problem));
  } catch (const std::exception& problem) {  // protobuf errors and bad_alloc
    throw make(problem.what());
  }
}

}  // namespace

Network::Network(const std::string& path) : path_(path), inputs_(onnx_input_list(path)) {
  limit_opencv_to_one_thread();  // the forked process in crash_signal_of has no other threads
  const Quiet quiet;
  const auto load = [&] {
    state_ = std::make_unique<State>(State{cv::dnn::readNetFromONNX(path)});
  };
  // OpenCV does not validate everything in a file: it divides by sizes of 0 and reads out of
  // bounds. Fuzzing with damaged files crashed only loading, never running.
  if (const std::string end = crash_signal_of(load); !end.empty())
    throw Error(fmt::format(
        "the network {} cannot be used: OpenCV crashes on it ({}); it is damaged or unsupported",
        path, end));
  with_their_words(load, [&](const std::string& words) {
    return Error(fmt::format("OpenCV cannot run the network {}: {}", path, words));
  });
}

std::vector<float> Network::run(const std::vector<NetworkValues>& values) {
  const Quiet quiet;
  std::vector<float> result;
  const auto forward = [&] {
    for (size_t i = 0; i < inputs_.size(); ++i)
      state_->net.setInput(blob(values.at(i)), inputs_[i].name);
    const cv::Mat out = state_->net.forward();
    result.assign(out.begin<float>(), out.end<float>());
  };
  with_their_words(forward, [](const std::string& words) { return NetworkFailed(words); });
  return result;
}

#else

struct Network::State {};

Network::Network(const std::string& path) : path_(path) {
  throw Error(
      fmt::format("the network {} needs OpenCV's dnn module, but this gflow was built without it: "
                  "install libopencv-dnn-dev and rebuild",
                  path));
}
std::vector<float> Network::run(const std::vector<NetworkValues>&) { return {}; }

#endif

Network::~Network() = default;
Network::Network(Network&&) noexcept = default;
Network& Network::operator=(Network&&) noexcept = default;

}  // namespace gflow
