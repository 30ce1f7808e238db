// SPDX-License-Identifier: Apache-2.0
// Contact sheets of an experiment.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgproc.hpp>
#include <set>

#include "apps/experiments/runs.hpp"
#include "apps/experiments/table.hpp"
#include "optim/eval/shown_images.hpp"
#include "optim/images/image.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow::experiments {
namespace {

namespace fs = std::filesystem;

constexpr int kCaption = 24;  // [px] height, above each image
constexpr int kMargin = 6;    // [px] beside the caption
constexpr auto kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kFontScale = 0.5;

int width_of(const std::string& words) {
  return cv::getTextSize(words, kFont, kFontScale, 1, nullptr).width + 2 * kMargin;
}

// Black caption on white above the image; white to the right of it up to `width`.
Image captioned(const Image& image, const std::string& words, int width) {
  cv::Mat sheet(image.height + kCaption, width, CV_8UC3, cv::Scalar(255, 255, 255));
  const cv::Mat shown(image.height, image.width, CV_8UC3,
                      const_cast<uint8_t*>(image.pixels.data()));
  if (!shown.empty()) shown.copyTo(sheet(cv::Rect(0, kCaption, image.width, image.height)));
  cv::putText(sheet, words, {kMargin, kCaption - 8}, kFont, kFontScale, cv::Scalar(0, 0, 0), 1,
              cv::LINE_AA);
  return {width, sheet.rows, 3, {sheet.data, sheet.data + sheet.total() * 3}};
}

Image readable(const std::string& path) {
  const Image image = read_image(path);
  return image.channels == 4 ? over_background(image, {255, 255, 255}) : image;
}

// Images below each other, each with a caption.
struct Sheet {
  std::string title;
  std::vector<std::pair<std::string, Image>> rows;

  void write(const std::string& path) const {
    int width = width_of(title);
    for (const auto& [words, image] : rows) width = std::max({width, image.width, width_of(words)});
    Image sheet = captioned({0, 0, 3, {}}, title, width);
    for (const auto& [words, image] : rows) {
      const Image row = captioned(image, words, width);
      sheet.pixels.insert(sheet.pixels.end(), row.pixels.begin(), row.pixels.end());
      sheet.height += row.height;
    }
    fs::create_directories(fs::path(path).parent_path());
    write_png(path, sheet);
  }
};

// The first training of a row on a scene, if its test views are rendered.
struct Drawn {
  const PlannedRun* run;
  std::string words, folder;
};
std::vector<Drawn> drawn_of(const Plan& plan, const std::string& folder, const std::string& scene) {
  std::vector<Drawn> drawn;
  for (size_t i = 0; i < plan.runs.size(); ++i) {
    const Row& row = plan.rows[plan.runs[i].row];
    const RunFiles files(folder, plan.runs[i].id);
    if (row.scene != scene || !is_first_seed(plan, i) || !fs::exists(files.run + "/compare.png"))
      continue;
    drawn.push_back({&plan.runs[i], name_of(row, row.scene), files.run});
  }
  return drawn;
}

std::vector<const Frame*> frames_of(const Film& film, const Scene& scene) {
  std::vector<const Frame*> frames;
  for (const Frame& frame : scene.test)
    if (frame.name.rfind(film.view + "_", 0) == 0 && size_t(frame.step) >= film.first &&
        size_t(frame.step) <= film.last)
      frames.push_back(&frame);
  return frames;
}

// The possible films of a scene: VIEW@FIRST-LAST, each view with all its steps.
std::string films_in_words(const Scene& scene) {
  std::map<std::string, std::pair<int, int>> steps;
  for (const Frame& frame : scene.test) {
    const std::string view = frame.name.substr(0, frame.name.rfind('_'));
    const auto [entry, is_new] = steps.try_emplace(view, frame.step, frame.step);
    if (!is_new) entry->second.second = std::max(entry->second.second, frame.step);
  }
  std::vector<std::string> words;
  for (const auto& [view, range] : steps)
    words.push_back(fmt::format("{}@{}-{}", view, range.first, range.second));
  return words.empty() ? "no test views" : fmt::format("{}", fmt::join(words, ", "));
}

// Time steps of a view from left to right, truth first; no rows if the scene lacks the view.
Sheet film_sheet(const Film& film, const std::string& scene, const std::vector<Drawn>& drawn) {
  Sheet sheet{fmt::format("{}, {}: steps {} to {}", scene, film.view, film.first, film.last), {}};
  const TrainOptions& config = drawn[0].run->config;
  const LoadedScene loaded = load_scene(config.scene, drawn[0].folder + "/frames");
  const std::vector<const Frame*> frames = frames_of(film, loaded.scene);
  if (frames.empty()) return sheet;
  std::vector<Image> truth;
  for (const Frame* frame : frames) truth.push_back(*loaded.frames->rgb(*frame));
  sheet.rows.emplace_back("truth", side_by_side(truth));
  for (const Drawn& row : drawn) {
    std::vector<Image> images;
    for (size_t k = 0; k < frames.size(); ++k) {
      const std::string path = fmt::format("{}/test/{}.png", row.folder, frames[k]->name);
      // White if the row has no such step, or an image of another size.
      Image image{truth[k].width, truth[k].height, 3, {}};
      if (fs::exists(path)) image = readable(path);
      if (image.pixels.empty() || image.height != truth[k].height)
        image = {truth[k].width, truth[k].height, 3,
                 std::vector<uint8_t>(truth[k].pixels.size(), 255)};
      images.push_back(image);
    }
    sheet.rows.emplace_back(row.words, side_by_side(images));
  }
  return sheet;
}

}  // namespace

void require_films(const Plan& plan) {
  if (plan.films.empty()) return;
  std::vector<std::pair<std::string, Scene>> scenes;  // with their names
  for (const PlannedRun& run : plan.runs) {
    const std::string& name = plan.rows[run.row].scene;
    if (scenes.empty() || scenes.back().first != name)
      scenes.emplace_back(name, read_scene(run.config.scene.path, run.config.scene));
  }
  for (const Film& film : plan.films) {
    std::vector<std::string> there;
    for (const auto& [name, scene] : scenes) {
      if (!frames_of(film, scene).empty()) break;
      there.push_back(fmt::format("{} has {}", name, films_in_words(scene)));
    }
    if (there.size() == scenes.size())
      throw Error(fmt::format("{}: no scene has test views for film {}@{}-{}: {}", plan.path,
                              film.view, film.first, film.last, fmt::join(there, "; ")));
  }
}

std::vector<std::string> write_contact_sheets(const Plan& plan, const std::string& folder) {
  std::vector<std::string> written;
  const auto write = [&](const Sheet& sheet, const std::string& name) {
    written.push_back(fmt::format("{}/pictures/{}.png", folder, name));
    sheet.write(written.back());
  };
  std::set<std::string> scenes;
  for (const Row& row : plan.rows) {
    if (!scenes.insert(row.scene).second) continue;
    const std::vector<Drawn> drawn = drawn_of(plan, folder, row.scene);
    if (drawn.empty()) continue;
    const std::string name = file_name(row.scene);
    Sheet sheet{row.scene + ": truth, rendered, error; flow, reference flow", {}};
    for (const Drawn& one : drawn)
      sheet.rows.emplace_back(one.words, readable(one.folder + "/compare.png"));
    write(sheet, name);
    for (const Film& film : plan.films)
      if (const Sheet strip = film_sheet(film, row.scene, drawn); !strip.rows.empty())
        write(strip, file_name(fmt::format("{}_{}_{}-{}", name, film.view, film.first, film.last)));
  }
  return written;
}

}  // namespace gflow::experiments
