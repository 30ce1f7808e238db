// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/view_source.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/common/found_above.hpp"
#include "apps/viewer/rounded_model.hpp"
#include "optim/formats/ply_rows.hpp"
#include "optim/images/decoded_image.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/runs/run_names.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr size_t kPoseBytes = size_t{256} << 20;  // of a model's baked poses, at most
constexpr double kPoseTolerance = 1.0 / 8;        // of exported ones, see thinned()
constexpr size_t kMetricLines = 5000;             // in one answer

// Folder or file without the folders around it.
std::string name_of_path(const std::string& path) {
  fs::path whole = fs::absolute(path).lexically_normal();
  if (whole.filename().empty()) whole = whole.parent_path();
  return whole.filename().string();
}

// As many digits as a float has, which is what cameras are drawn with.
double float_digits(double value) {
  return std::strtod(fmt::format("{:.9g}", value).c_str(), nullptr);
}

Json json_of(const Camera& camera) {
  Json viewmat = Json::array();
  for (long r = 0; r < 4; ++r)
    for (long c = 0; c < 4; ++c) viewmat.push_back(float_digits(camera.viewmat(r, c)));
  return {{"name", camera.name}, {"width", camera.width}, {"height", camera.height},
          {"fx", camera.fx},     {"fy", camera.fy},       {"cx", camera.cx},
          {"cy", camera.cy},     {"viewmat", viewmat}};
}

// Upwards in a PLY that gflow exported, or -y.
std::array<double, 3> up_of_file(const std::string& path) {
  std::vector<std::string> comments;
  if (splat_format(path) == SplatFormat::ply) comments = PlyRows(path).header().comments;
  for (const std::string& comment : comments)
    if (std::array<double, 3> up{};
        std::sscanf(comment.c_str(), "up %lf %lf %lf", &up[0], &up[1], &up[2]) == 3)
      return up;
  return {0, -1, 0};
}

}  // namespace

// File of a model.
struct ViewSource::Place {
  std::string path, tag;
  int iteration = 0;
};

// A camera of info().
struct ViewSource::View {
  Camera camera;
  const char* split = "view";
  const Frame* frame = nullptr;  // with its image, or null
};

ViewSource::ViewSource(const std::string& run_or_file, int iteration, Undrawable undrawable,
                       ViewDevice& device)
    : path_(run_or_file),
      name_(name_of_path(run_or_file)),
      iteration_(iteration),
      undrawable_(undrawable),
      device_(device) {
  if (!fs::exists(path_))
    throw Error(fmt::format("cannot read {}: there is no such run folder or splat file", path_));
  if (fs::is_directory(path_)) {
    run_ = RunFolder::open(path_);
    config_ = run_->read_config();
    return;
  }
  if (fs::path(path_).extension() == ".html")
    throw Error(fmt::format("viewing {}: it is a page of its own; open it in a browser", path_));
  if (splat_format(path_) == SplatFormat::four_dgs)
    throw Error(fmt::format(
        "viewing {}: its linear pieces are no model of gflow; drop the file on the page of another "
        "one, or view the run that it was exported from",
        path_));
}

ViewSource::ViewSource(const std::string& run, const TrainOptions& config,
                       std::shared_ptr<LiveModel> live, ViewDevice& device)
    : path_(run),
      name_(name_of_path(run)),
      iteration_(latest_iteration),
      undrawable_(Undrawable::left_out),
      device_(device),
      run_(RunFolder(run)),
      config_(config),
      live_(std::move(live)) {}

bool ViewSource::is_live() const {
  if (live_) return live_->is_training();
  if (!run_ || run_->read_facts().finished) return false;
  const std::string holder = read_report_or_empty(run_->path(kRunLock));
  const long pid = std::strtol(holder.c_str(), nullptr, 10);
  return pid > 0 && (::kill(pid_t(pid), 0) == 0 || errno == EPERM);
}

std::optional<ViewSource::Place> ViewSource::newest_place() const {
  Place place{path_, "", 0};
  if (is_in_training()) {
    place.iteration = live_->newest_step();
    place.tag = fmt::format("training-{}", place.iteration);
    return place;
  }
  if (live_ && live_->steps_done() == 0) return std::nullopt;  // a run that this one replaces
  if (run_) {
    std::vector<int> iterations = iterations_of(*run_);
    if (iteration_ != latest_iteration) iterations = {iteration_};
    if (iterations.empty()) return std::nullopt;
    place.iteration = iterations.back();
    place.path = run_->model_path(place.iteration);
    if (!fs::exists(place.path)) place.path = run_->checkpoints().path(place.iteration);
  }
  std::error_code gone;  // training replaces checkpoints
  const uintmax_t bytes = fs::file_size(place.path, gone);
  if (gone) return std::nullopt;
  const auto written = fs::last_write_time(place.path, gone).time_since_epoch().count();
  place.tag = fmt::format("{}-{}-{:x}", place.iteration, bytes, uint64_t(written));
  return place;
}

Json ViewSource::state() {
  const std::optional<Place> place = newest_place();
  Json state{{"iteration", place ? place->iteration : 0},
             {"iterations", run_ ? config_.train.iterations : 0},
             {"live", is_live()},
             {"model", nullptr}};
  if (place) state["model"] = place->tag;
  return state;
}

HostModel ViewSource::read_model_at(Place& place) {
  if (is_in_training()) {
    const auto reading = live_->newest();
    if (!reading) throw NotYet(fmt::format("no training step of {} has ended yet", name_));
    place.iteration = reading->step;
    place.tag = fmt::format("training-{}", reading->step);
    return reading->model;
  }
  if (!run_) return read_model(path_, undrawable_);
  // A given iteration is read as such; the newest may be newer than `place` by now.
  RunState state = read_run_state(*run_, iteration_);
  if (iteration_ == latest_iteration && state.iteration < place.iteration)
    throw Error(fmt::format("{} is damaged", place.path));
  return std::move(state.model);
}

ViewSource::Place ViewSource::newest_place_or_throw() const {
  std::optional<Place> place = newest_place();
  if (!place)
    throw NotYet(
        fmt::format("{} has no model yet: training saves the first one after "
                    "train.checkpoint_every or train.save_every steps, or at its end",
                    name_));
  return std::move(*place);
}

std::string ViewSource::bytes_of(const HostModel& model, ViewPrecision precision) {
  origin_ = model.shape.origin;
  const ViewFacts about = facts(model);  // loads the scene
  std::optional<BakedPoses> poses;
  if (needs_poses(model))
    poses = device_.with_queue([&](Queue& queue) {
      return bake_poses(queue, model, times_within(pose_times(), model.num_moving(), kPoseBytes));
    });
  if (poses && precision == ViewPrecision::half) poses = thinned(*poses, model, kPoseTolerance);
  return view_model_bytes(model, poses ? &*poses : nullptr, about, precision);
}

ViewSource::Packed ViewSource::model() {
  const std::lock_guard<std::mutex> lock(model_mutex_);
  Place place = newest_place_or_throw();
  if (packed_ && tag_ == place.tag) return {tag_, packed_};
  packed_ =
      std::make_shared<const std::string>(bytes_of(read_model_at(place), ViewPrecision::full));
  tag_ = place.tag;
  return {tag_, packed_};
}

ViewSource::FileModel ViewSource::model_of_file(const Selection& selection, bool compact) {
  const std::lock_guard<std::mutex> lock(model_mutex_);
  Place place = newest_place_or_throw();
  HostModel model = read_model_at(place);
  origin_ = model.shape.origin;
  const ViewFacts about = facts(model);  // loads the scene, which has the times
  FileModel file;
  file.whole = model.count;
  if (!selection.is_everything()) {
    model = device_.with_queue(
        [&](Queue& queue) { return selected(queue, model, selection, pose_times()); });
    require_some_left(model, file.whole, path_);
  }
  file.count = model.count;
  file.rounds_motion = needs_poses(model) || model.shape.motion == MotionModelKind::keyframes;
  if (compact) {
    HostModel rounded = rounded_model(model);
    file.psnr = device_.with_queue([&](Queue& queue) {
      return psnr_between(queue, rounded, model, some_views(model), engine_settings(config_),
                          about.near);
    });
    model = std::move(rounded);
  }
  file.bytes = bytes_of(model, ViewPrecision::half);
  return file;
}

// Eight of the run's cameras and times, or of an orbit.
std::vector<RenderView> ViewSource::some_views(const HostModel& model) {
  constexpr size_t kViews = 8;
  const std::lock_guard<std::mutex> lock(scene_mutex_);
  const std::vector<View> all = views();
  if (all.empty()) return orbit_views(model, parse_times(fmt::format("0:1:{}", kViews)), "-y");
  std::vector<RenderView> some;
  for (size_t k = 0; k < std::min(kViews, all.size()); ++k) {
    const View& view = all[k * all.size() / std::min(kViews, all.size())];
    RenderView& chosen = some.emplace_back();
    chosen.camera = view.camera;
    chosen.time = view.frame ? view.frame->time : double(k) / kViews;
  }
  return some;
}

void ViewSource::load_scene_once() {
  if (scene_was_tried_) return;
  if (live_ && live_->steps_done() == 0) return;  // it may be unpacking a video
  scene_was_tried_ = true;
  if (!run_) return;
  if (!fs::exists(config_.scene.path)) {
    notices_.push_back(
        "the scene of this run does not exist any more, so there are no true images");
    return;
  }
  try {
    // Frames of videos that training unpacked; a folder of this program otherwise.
    const std::string unpacked = run_->path("frames");
    loaded_ = load_scene(config_.scene, fs::is_directory(unpacked) ? unpacked : "", origin_);
  } catch (const Error& problem) {
    notices_.push_back(fmt::format("the scene cannot be read: {}", problem.what()));
  }
}

// With the cameras as training has corrected them so far.
std::vector<ViewSource::View> ViewSource::views() {
  load_scene_once();
  std::vector<View> views;
  if (loaded_) {
    const Scene& scene = loaded_->scene;
    if (refines_cameras(config_.cameras, scene) && fs::exists(run_->path("cameras.json")))
      run_->move_cameras(*loaded_->frames);
    const std::pair<const char*, const std::vector<Frame>*> splits[] = {
        {"train", &scene.train}, {"test", &scene.test}, {"val", &scene.val}};
    for (const auto& [split, frames] : splits)
      for (const Frame& frame : *frames)
        views.push_back({loaded_->frames->camera(frame), split, &frame});
    return views;
  }
  const std::string json = run_ ? run_->path("cameras.json") : found_above(path_, "cameras.json");
  if (json.empty() || !fs::exists(json)) return views;
  for (const Camera& camera : read_cameras_json(json, run_ ? config_.scene.resolution : 1))
    views.push_back({camera});
  return views;
}

Json ViewSource::info() {
  const std::optional<Place> place = newest_place();
  const std::lock_guard<std::mutex> lock(scene_mutex_);
  Json cameras = Json::array();
  for (const View& view : views()) {
    Json camera = json_of(view.camera);
    camera["split"] = view.split;
    camera["time"] = view.frame ? view.frame->time : 0;
    camera["step"] = view.frame ? view.frame->step : 0;
    camera["image"] = view.frame != nullptr;
    if (view.frame) camera["frame"] = view.frame->name;
    cameras.push_back(std::move(camera));
  }
  Json metrics;
  if (run_) metrics = Json::parse(read_report_or_empty(run_->path("results.json")), nullptr, false);
  if (metrics.is_discarded()) metrics = nullptr;
  const std::vector<double> times = loaded_ ? step_times(loaded_->scene) : std::vector<double>();
  return {{"name", name_},
          {"kind", run_ ? "run" : "file"},
          {"steps", times.size()},
          {"times", times},
          {"fps", loaded_ ? Json(loaded_->scene.fps) : Json()},
          {"iteration", place ? place->iteration : 0},
          {"iterations", run_ ? config_.train.iterations : 0},
          {"live", is_live()},
          {"cameras", std::move(cameras)},
          {"metrics", std::move(metrics)},
          {"notices", notices_}};
}

Json ViewSource::info_of_file() {
  Json whole = info();
  whole["live"] = false;
  whole["notices"] = Json::array();
  for (Json& camera : whole["cameras"]) camera["image"] = false;
  whole["lines"] = metrics(0)["lines"];
  return whole;
}

ViewFacts ViewSource::facts(const HostModel& model) {
  const std::lock_guard<std::mutex> lock(scene_mutex_);
  ViewFacts facts;
  std::vector<Camera> cameras;
  for (const View& view : views()) cameras.push_back(view.camera);
  const EngineSettings settings = engine_settings(config_);
  const float level = float(shown_level(config_.scene.background)) / 255;
  facts.background = {level, level, level};
  facts.stop = settings.stop;
  facts.transport = settings.transport;
  if (const auto up = mean_up(cameras))
    facts.up = *up;
  else if (!run_)
    facts.up = up_of_file(path_);
  facts.extent = extent_of(model);
  if (loaded_) {
    facts.steps = size_t(loaded_->scene.steps);
    facts.fps = loaded_->scene.fps;
    facts.near = double(near_or_default(config_.render.near, loaded_->scene));
    facts.extent = loaded_->scene.extent;
  } else if (config_.render.near > 0) {
    facts.near = double(config_.render.near);
  } else if (!cameras.empty() && cameras[0].near > 0) {
    facts.near = cameras[0].near;
  }
  return facts;
}

// Times of all images; without a scene, 40 from 0 to 1.
std::vector<double> ViewSource::pose_times() const {
  if (!loaded_) return parse_times("0:1:40");
  std::set<double> times;
  for (const auto* frames : {&loaded_->scene.train, &loaded_->scene.test, &loaded_->scene.val})
    for (const Frame& frame : *frames) times.insert(frame.time);
  return {times.begin(), times.end()};
}

std::vector<uint8_t> ViewSource::image(size_t index) {
  const std::lock_guard<std::mutex> lock(scene_mutex_);
  load_scene_once();
  if (loaded_)
    for (const auto* frames : {&loaded_->scene.train, &loaded_->scene.test, &loaded_->scene.val}) {
      if (index < frames->size()) {
        const std::shared_ptr<const Image> image = loaded_->frames->rgb((*frames)[index]);
        return encode_png({image->width, image->height, image->channels, 8, image->pixels.data()});
      }
      index -= frames->size();
    }
  throw NoSuchView(fmt::format("{} has no image of this camera", name_));
}

Json ViewSource::metrics(size_t from) const {
  const std::string text = run_ ? read_text_or_empty(run_->path("metrics.jsonl")) : "";
  std::string_view rest = text;
  rest = rest.substr(0, rest.rfind('\n') == std::string_view::npos ? 0 : rest.rfind('\n') + 1);
  if (from > size_t(std::count(rest.begin(), rest.end(), '\n'))) from = 0;
  Json lines = Json::array();
  size_t next = 0;
  for (; !rest.empty() && next < from + kMetricLines; ++next) {
    const std::string_view line = take_line(rest);
    if (next < from) continue;
    Json values = RunFolder::metrics_of(line);
    if (!values.is_discarded()) lines.push_back(std::move(values));
  }
  return {{"from", from}, {"lines", std::move(lines)}, {"next", next}};
}

}  // namespace gflow
