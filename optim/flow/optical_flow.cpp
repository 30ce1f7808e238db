// SPDX-License-Identifier: Apache-2.0
// DIS flow (Kroeger et al. 2016) by OpenCV, and its forward-backward consistency.
#include "optim/flow/optical_flow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "optim/flow/changed_regions.hpp"
#include "optim/images/opencv_threads.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// Smaller images are padded: DIS needs a patch on each of its pyramid levels.
constexpr int smallest_side = 16;

cv::Mat grey(const Image& image) {
  cv::Mat result;
  cv::cvtColor(
      cv::Mat(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data())),
      result, cv::COLOR_RGB2GRAY);
  return result;
}

cv::Mat part_of(const cv::Mat& image, const Rect& part) {
  cv::Mat result;
  cv::copyMakeBorder(image({part.x, part.y, part.width, part.height}), result, 0,
                     std::max(0, smallest_side - part.height), 0,
                     std::max(0, smallest_side - part.width), cv::BORDER_REPLICATE);
  return result;
}

// Where the camera moves, patches 3 px apart are nearly as good as on every pixel (README.md), and
// seven times faster. In the parts that move before a camera at rest, fine things in fast motion
// need all in small images; in larger ones they span more pixels. More iterations of either kind do
// not give better flow.
cv::Ptr<cv::DISOpticalFlow> dis_for(CameraMotion camera, int longer_side) {
  constexpr int widest = 3, pixels_per_stride = 200;
  const int stride = camera == CameraMotion::none
                         ? std::clamp(longer_side / pixels_per_stride, 1, widest)
                         : widest;
  auto dis = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
  dis->setFinestScale(0);
  dis->setPatchSize(8);
  dis->setPatchStride(stride);
  dis->setGradientDescentIterations(25);
  dis->setVariationalRefinementIterations(5);
  return dis;
}

cv::Ptr<cv::DISOpticalFlow> quick_dis() {
  auto dis = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
  dis->setFinestScale(0);
  dis->setPatchStride(4);
  return dis;
}

void check_pair(const Image& a, const Image& b) {
  const bool rgb = a.channels == 3 && b.channels == 3;
  if (!rgb || a.width != b.width || a.height != b.height || a.width < 1 || a.height < 1)
    throw Error(
        fmt::format("cannot estimate flow from a {}x{} image with {} channels to a {}x{} image "
                    "with {}: both must be RGB and of equal size",
                    a.width, a.height, a.channels, b.width, b.height, b.channels));
}

// Bilinear sample of a flow at pixel indices (x, y); false outside of the image or if one of the
// four neighbours is invalid.
bool sample(const FlowField& flow, float x, float y, float result[2]) {
  if (!(x >= 0 && y >= 0 && x <= float(flow.width - 1) && y <= float(flow.height - 1)))
    return false;
  const int x0 = std::min(int(x), std::max(0, flow.width - 2));
  const int y0 = std::min(int(y), std::max(0, flow.height - 2));
  const float fx = x - float(x0), fy = y - float(y0);
  result[0] = result[1] = 0;
  for (int corner = 0; corner < 4; ++corner) {
    const int cx = std::min(x0 + (corner & 1), flow.width - 1);
    const int cy = std::min(y0 + (corner >> 1), flow.height - 1);
    const float weight = (corner & 1 ? fx : 1 - fx) * (corner >> 1 ? fy : 1 - fy);
    const size_t i = size_t(cy) * size_t(flow.width) + size_t(cx);
    if (!flow.valid[i]) return false;
    result[0] += weight * flow.uv[2 * i];
    result[1] += weight * flow.uv[2 * i + 1];
  }
  return true;
}

FlowField field_of(const cv::Mat& uv, int width, int height) {
  FlowField flow = zero_flow(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      const auto& f = uv.at<cv::Point2f>(y, x);
      flow.valid[i] = std::isfinite(f.x) && std::isfinite(f.y);
      if (!flow.valid[i]) continue;
      flow.uv[2 * i] = f.x;
      flow.uv[2 * i + 1] = f.y;
    }
  return flow;
}

void paste(const TargetFlow& from, const Rect& at, TargetFlow& to) {
  for (int y = 0; y < at.height; ++y)
    for (int x = 0; x < at.width; ++x) {
      const size_t i = size_t(y) * size_t(at.width) + size_t(x);
      const size_t j = size_t(at.y + y) * size_t(to.flow.width) + size_t(at.x + x);
      to.flow.valid[j] = from.flow.valid[i];
      std::copy_n(&from.flow.uv[2 * i], 2, &to.flow.uv[2 * j]);
      to.confidence[j] = from.confidence[i];
    }
}

std::pair<TargetFlow, TargetFlow> flows_in(const std::vector<Rect>& parts, const Image& a,
                                           const Image& b, cv::DISOpticalFlow& dis) {
  check_pair(a, b);
  limit_opencv_to_one_thread();
  const cv::Mat first = grey(a), second = grey(b);
  TargetFlow there{zero_flow(a.width, a.height), {}};
  there.confidence.assign(there.flow.valid.size(), 255);
  TargetFlow back = there;
  for (const Rect& part : parts) {
    const cv::Mat from = part_of(first, part), to = part_of(second, part);
    cv::Mat uv_there, uv_back;
    dis.calc(from, to, uv_there);
    dis.calc(to, from, uv_back);
    TargetFlow part_there{field_of(uv_there, part.width, part.height), {}};
    TargetFlow part_back{field_of(uv_back, part.width, part.height), {}};
    part_there.confidence = consistency(part_there.flow, part_back.flow);
    part_back.confidence = consistency(part_back.flow, part_there.flow);
    paste(part_there, part, there);
    paste(part_back, part, back);
  }
  return {there, back};
}

}  // namespace

std::vector<uint8_t> consistency(const FlowField& forward, const FlowField& backward) {
  constexpr float absolute = 0.5f, relative = 0.05f;
  std::vector<uint8_t> confidence(forward.valid.size());
  for (int y = 0; y < forward.height; ++y)
    for (int x = 0; x < forward.width; ++x) {
      const size_t i = size_t(y) * size_t(forward.width) + size_t(x);
      const float u = forward.uv[2 * i], v = forward.uv[2 * i + 1];
      float back[2];
      if (!forward.valid[i] || !sample(backward, float(x) + u, float(y) + v, back)) continue;
      const float gap = std::hypot(u + back[0], v + back[1]);
      if (gap < std::max(absolute, relative * std::hypot(u, v))) confidence[i] = 255;
    }
  return confidence;
}

std::pair<TargetFlow, TargetFlow> estimate_target_flows(const Image& a, const Image& b,
                                                        CameraMotion camera) {
  check_pair(a, b);
  return flows_in(camera == CameraMotion::none ? changed_regions(a, b)
                                               : std::vector<Rect>{{0, 0, a.width, a.height}},
                  a, b, *dis_for(camera, std::max(a.width, a.height)));
}

std::pair<TargetFlow, TargetFlow> estimate_quick_flows(const Image& a, const Image& b) {
  return flows_in({{0, 0, a.width, a.height}}, a, b, *quick_dis());
}

TargetFlow resized(const TargetFlow& target_flow, int width, int height) {
  const FlowField& from = target_flow.flow;
  if (from.width == width && from.height == height) return target_flow;
  TargetFlow result{zero_flow(width, height), {}};
  result.confidence.resize(result.flow.valid.size());
  const float sx = float(width) / float(from.width), sy = float(height) / float(from.height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const int from_x = std::min(int((float(x) + .5f) / sx), from.width - 1);
      const int from_y = std::min(int((float(y) + .5f) / sy), from.height - 1);
      const size_t j = size_t(from_y) * size_t(from.width) + size_t(from_x);
      const size_t i = size_t(y) * size_t(width) + size_t(x);
      result.flow.uv[2 * i] = from.uv[2 * j] * sx;
      result.flow.uv[2 * i + 1] = from.uv[2 * j + 1] * sy;
      result.flow.valid[i] = from.valid[j];
      result.confidence[i] = target_flow.confidence[j];
    }
  return result;
}

}  // namespace gflow
