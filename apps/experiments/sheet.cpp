// SPDX-License-Identifier: Apache-2.0
// Contact sheets of an experiment.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgproc.hpp>

#include "apps/experiments/runs.hpp"
#include "apps/experiments/table.hpp"
#include "optim/data/image.hpp"

namespace gflow::experiments {
namespace {

namespace fs = std::filesystem;

constexpr int kCaption = 24;  // [px] high, above each picture

// Black words on white above the picture, and white to the right of it up to `width`.
Image captioned(const Image& picture, const std::string& words, int width) {
  cv::Mat sheet(picture.height + kCaption, width, CV_8UC3, cv::Scalar(255, 255, 255));
  const cv::Mat shown(picture.height, picture.width, CV_8UC3,
                      const_cast<uint8_t*>(picture.pixels.data()));
  if (!shown.empty()) shown.copyTo(sheet(cv::Rect(0, kCaption, picture.width, picture.height)));
  cv::putText(sheet, words, {6, kCaption - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar(0, 0, 0),
              1, cv::LINE_AA);
  return {width, sheet.rows, 3, {sheet.data, sheet.data + sheet.total() * 3}};
}

}  // namespace

std::vector<std::string> write_contact_sheets(const Plan& plan, const std::string& folder) {
  std::map<std::string, std::vector<std::pair<std::string, Image>>> pictures;  // by scene
  for (size_t i = 0; i < plan.runs.size(); ++i) {
    const bool first_seed = i == 0 || plan.runs[i - 1].row != plan.runs[i].row;
    const std::string path = RunFiles(folder, plan.runs[i].id).run + "/compare.png";
    if (!first_seed || !fs::exists(path)) continue;
    const Row& row = plan.rows[plan.runs[i].row];
    Image picture = read_image(path);
    if (picture.channels == 4) picture = over_background(picture, {255, 255, 255});
    pictures[row.scene].emplace_back(
        row.choices.empty() ? row.scene : fmt::format("{}", fmt::join(row.choices, ", ")), picture);
  }
  std::vector<std::string> written;
  for (const auto& [scene, rows] : pictures) {
    int width = 0;
    for (const auto& [words, picture] : rows) width = std::max(width, picture.width);
    Image sheet =
        captioned({0, 0, 3, {}}, scene + ": truth, rendered, error; flow, reference flow", width);
    for (const auto& [words, picture] : rows) {
      const Image row = captioned(picture, words, width);
      sheet.pixels.insert(sheet.pixels.end(), row.pixels.begin(), row.pixels.end());
      sheet.height += row.height;
    }
    fs::create_directories(folder + "/pictures");
    written.push_back(
        fmt::format("{}/pictures/{}.png", folder, fs::path(scene).filename().string()));
    write_png(written.back(), sheet);
  }
  return written;
}

}  // namespace gflow::experiments
