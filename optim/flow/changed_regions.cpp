// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/changed_regions.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace gflow {
namespace {

// Means over 5 x 5 pixels: noise of JPEG and video largely cancels.
constexpr int kWindow = 5;
constexpr double kNoise = 4;      // [grey levels] of such means
constexpr int kFewPixels = 16;    // smaller changes are noise
constexpr int kLeastMargin = 16;  // [px]
constexpr int kMarginShare = 40;  // margin: this part of the longer side

cv::Mat smooth(const Image& image) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.pixels.data()));
  cv::Mat mean;
  cv::blur(rgb, mean, {kWindow, kWindow});
  return mean;
}

// 255 where the images differ, without specks.
cv::Mat changed(const Image& a, const Image& b) {
  cv::Mat difference, channels[3];
  cv::absdiff(smooth(a), smooth(b), difference);
  cv::split(difference, channels);
  const cv::Mat most = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  cv::Mat mask = most > kNoise, labels, stats, centres;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centres);
  std::vector<uint8_t> keeps(size_t(count), 0);
  for (int i = 1; i < count; ++i)
    keeps[size_t(i)] = stats.at<int>(i, cv::CC_STAT_AREA) >= kFewPixels ? 255 : 0;
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      mask.at<uint8_t>(y, x) = keeps[size_t(labels.at<int>(y, x))];
  return mask;
}

// Joins rectangles until none overlap.
void join(std::vector<cv::Rect>& rects) {
  for (size_t i = 0; i < rects.size(); ++i)
    for (size_t j = 0; j < i; ++j)
      if ((rects[i] & rects[j]).area() > 0) {
        rects[j] |= rects[i];
        rects.erase(rects.begin() + long(i));
        i = 0;  // the larger one may overlap earlier ones
        break;
      }
}

}  // namespace

std::vector<Rect> changed_regions(const Image& a, const Image& b) {
  const int margin = std::max(kLeastMargin, std::max(a.width, a.height) / kMarginShare);
  const cv::Mat reach = cv::Mat::ones(2 * margin + 1, 2 * margin + 1, CV_8U);
  cv::Mat mask, labels, stats, centres;
  cv::dilate(changed(a, b), mask, reach);
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centres);
  std::vector<cv::Rect> rects;
  for (int i = 1; i < count; ++i)
    rects.emplace_back(stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                       stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT));
  join(rects);
  std::vector<Rect> regions;
  for (const cv::Rect& rect : rects) regions.push_back({rect.x, rect.y, rect.width, rect.height});
  return regions;
}

}  // namespace gflow
