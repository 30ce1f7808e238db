// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/colmap.hpp"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "optim/cameras/camera_scene.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/running_program.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

constexpr size_t kMostImagesInAllPairs = 200;
constexpr int kStages = 4;

std::string find_colmap() {
  const std::string path = find_on_path("colmap");
  if (path.empty())
    throw Error(
        "the program colmap is not on PATH; install it (apt install colmap), or use --method "
        "tracks, which needs no other program");
  return path;
}

void write_frames(const std::string& folder, const LoadedScene& video, bool quiet) {
  const std::vector<Frame>& frames = video.scene.train;
  Progress progress("frames", long(frames.size()), quiet);
  for (size_t k = 0; k < frames.size(); ++k) {
    write_png(folder + "/" + image_name(k), *video.frames->rgb(frames[k]));
    progress.advance();
  }
  progress.finish();
}

std::string text_if_any(const std::string& path) {
  if (!fs::exists(path)) return "";
  const Bytes bytes = read_file(path);
  return {bytes.begin(), bytes.end()};
}

// Runs COLMAP's commands, one after the other.
class Colmap {
 public:
  Colmap(const std::string& program, const ColmapOptions& options, const std::string& folder)
      : program_(program), folder_(folder), kept_log_(options.kept_log), quiet_(options.quiet) {}

  std::string help_of(const std::string& command) {
    wait_for({command, "-h"}, folder_ + "/help");
    return text_if_any(folder_ + "/help");
  }

  // `stage`: what it does, for the user. Returns the status of the process.
  int status_of(const std::string& stage, const Arguments& arguments) {
    ++stage_;
    if (!quiet_) print_status("colmap  {}/{}  {}\n", stage_, kStages, stage);
    return wait_for(arguments, folder_ + "/log");
  }

  void run(const std::string& stage, const Arguments& arguments) {
    if (const int status = status_of(stage, arguments)) fail_at(arguments[0], status);
  }

  std::string log() const { return text_if_any(folder_ + "/log"); }

  [[noreturn]] void fail_at(const std::string& command, int status) const {
    fail(fmt::format("colmap {} {}", command, ending_of(status)));
  }
  [[noreturn]] void fail(const std::string& what) const {
    if (fs::path(kept_log_).has_parent_path())
      fs::create_directories(fs::path(kept_log_).parent_path());
    write_file_atomically(kept_log_, log());
    throw Error(fmt::format("{}; its output is in {}", what, kept_log_));
  }

 private:
  int wait_for(Arguments arguments, const std::string& log) {
    arguments.insert(arguments.begin(), program_);
    const InterruptGuard guard;
    RunningProgram program(std::move(arguments), log);
    while (!program.has_ended()) {
      if (interrupted())
        throw Interrupted("interrupted while COLMAP was finding cameras; nothing was written");
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return program.status();
  }

  std::string program_, folder_, kept_log_;
  bool quiet_;
  int stage_ = 0;  // from 1
};

void add_camera(const ColmapOptions& options, const Camera& size, Arguments& arguments) {
  for (const char* word : {"--ImageReader.single_camera", "1", "--ImageReader.camera_model",
                           options.radial ? "SIMPLE_RADIAL" : "SIMPLE_PINHOLE"})
    arguments.push_back(word);
  if (options.focal == 0) return;
  arguments.push_back("--ImageReader.camera_params");
  arguments.push_back(fmt::format("{:.9g},{},{}{}", options.focal, 0.5 * size.width,
                                  0.5 * size.height, options.radial ? ",0" : ""));
}

}  // namespace

ColmapResult reconstruct_with_colmap(const LoadedScene& video, const ColmapOptions& options) {
  const std::vector<Frame>& frames = video.scene.train;
  const std::string program = find_colmap();
  const ScratchFolder scratch("colmap");
  const std::string images = scratch.path() + "/images", sparse = scratch.path() + "/sparse",
                    text = scratch.path() + "/text", database = scratch.path() + "/database";
  for (const std::string& folder : {images, sparse, text}) fs::create_directories(folder);
  write_frames(images, video, options.quiet);

  Colmap colmap(program, options, scratch.path());
  // Newer versions of COLMAP have other names for the options of extraction and matching.
  const bool renamed =
      colmap.help_of("feature_extractor").find("FeatureExtraction.use_gpu") != std::string::npos;
  const std::string kind = renamed ? "Feature" : "Sift";
  Arguments extractor{"feature_extractor",
                      "--database_path",
                      database,
                      "--image_path",
                      images,
                      "--" + kind + "Extraction.use_gpu",
                      "0"};
  add_camera(options, video.frames->camera(frames[0]), extractor);
  colmap.run("finding features", extractor);
  const bool all_pairs =
      fs::is_directory(video.scene.folder) && frames.size() <= kMostImagesInAllPairs;
  colmap.run("matching images",
             {all_pairs ? "exhaustive_matcher" : "sequential_matcher", "--database_path", database,
              "--" + kind + "Matching.use_gpu", "0"});
  const bool focal_is_given = options.focal > 0;
  const int status = colmap.status_of(
      "placing images",
      {"mapper", "--database_path", database, "--image_path", images, "--output_path", sparse,
       "--Mapper.ba_refine_focal_length", focal_is_given ? "0" : "1"});
  std::vector<std::string> notices;
  const std::string model = find_colmap_model(sparse, notices);
  // COLMAP also exits with an error if it only finds no model.
  const bool none =
      status == 0 || colmap.log().find("failed to create sparse model") != std::string::npos;
  if (model.empty() && none)
    colmap.fail(fmt::format("COLMAP could place none of the {} frames", frames.size()));
  if (status != 0) colmap.fail_at("mapper", status);
  if (!notices.empty())
    warn("COLMAP could not join all frames that it placed into one model; the largest is used");
  colmap.run("writing the model", {"model_converter", "--input_path", model, "--output_path", text,
                                   "--output_type", "TXT"});
  return {read_colmap_tracks(text, frames.size()), colmap.log()};
}

}  // namespace gflow
