// SPDX-License-Identifier: Apache-2.0
// `gflow train`: trains a scene folder into a run folder.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "apps/common/command_line.hpp"
#include "apps/common/compile_ahead.hpp"
#include "apps/common/options.hpp"
#include "apps/common/report.hpp"
#include "apps/common/version.hpp"
#include "apps/common/view_options.hpp"
#include "apps/report/recorded_notices.hpp"
#include "apps/report/write_run_report.hpp"
#include "apps/viewer/server.hpp"
#include "optim/eval/metric_networks.hpp"
#include "optim/options/quality.hpp"
#include "optim/runs/follow.hpp"
#include "optim/runs/train_run.hpp"
#include "optim/runs/video_cameras.hpp"
#include "optim/train/guidance_provider.hpp"
#include "optim/train/team.hpp"
#include "runtime/base/decimal.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/ranks/ranks.hpp"

namespace gflow {
namespace {

struct TrainFlags {
  std::string scene, run, quality, config_file, init, cameras, method;
  std::vector<std::string> settings, devices;
  int iterations = 0, resolution = 1;
  int save_every = 0;
  Undrawable undrawable = Undrawable::left_out;
  int64_t seed = 0;
  bool profile = false;
  bool resume = false, overwrite = false, allow_command = false, still = false, view = false;
  ServerOptions server{"127.0.0.1", 8008};  // of --view
  bool open = false;
};

// Accepts the number of steps of a training.
CLI::Validator training_steps() {
  return CLI::Validator(
      [](std::string& text) {
        constexpr int most = std::numeric_limits<int>::max();
        const auto value = decimal_number(text);
        const bool whole = value && *value >= 1 && *value <= most && *value == std::floor(*value);
        return whole ? ""
                     : fmt::format(
                           "'{}' is not a number of training steps; training needs at "
                           "least one, so give a whole number from 1 to {}",
                           text, most);
      },
      "");
}

// Kernel times, longest first.
void print_timings(Queue& queue) {
  std::vector<std::pair<std::string, KernelTiming>> rows(queue.timings().begin(),
                                                         queue.timings().end());
  std::sort(rows.begin(), rows.end(),
            [](const auto& a, const auto& b) { return a.second.total_ms > b.second.total_ms; });
  print_result("{:<22} {:>9} {:>12} {:>10}\n", "kernel", "launches", "total [ms]", "each [ms]");
  for (const auto& [name, t] : rows)
    print_result("{:<22} {:>9} {:>12.1f} {:>10.3f}\n", name, t.count, t.total_ms,
                 t.total_ms / double(t.count));
}

TrainOptions configured(const TrainFlags& flags, const CLI::App& command) {
  TrainOptions config;
  if (flags.resume) RunFolder::require_no_pending_replacement(flags.run);
  if (flags.resume && RunFolder::is_run(flags.run))
    config = RunFolder::open(flags.run).read_config();
  const std::string command_of_run = config.guidance.command;
  if (!flags.quality.empty()) apply_quality(config, flags.quality);
  if (!flags.config_file.empty()) apply_file(config, flags.config_file);
  const bool of_run = config.guidance.command == command_of_run;
  bool by_hand = flags.allow_command;  // allowed on the command line
  for (const std::string& setting : flags.settings) {
    apply_setting(config, setting);
    by_hand |= setting.rfind("guidance.command", 0) == 0;
  }
  if (!by_hand) require_no_program(config, of_run ? flags.run : flags.config_file);
  if (!flags.scene.empty())
    config.scene.path = std::filesystem::absolute(flags.scene).lexically_normal().string();
  else if (!flags.resume)
    throw CLI::RequiredError("SCENE");
  else if (config.scene.path.empty())
    throw Error(
        fmt::format("resuming {}: it has no config.toml with the path of the scene; run gflow "
                    "train SCENE -o {} --resume",
                    flags.run, flags.run));
  const auto words = names_of(InitFrom{});
  const auto word = std::find(words.begin(), words.end(), flags.init);
  if (word != words.end()) {
    config.init.from = InitFrom(word - words.begin());
  } else if (!flags.init.empty()) {
    if (!std::filesystem::exists(flags.init))
      throw Error(fmt::format("--init {}: no such file; give a file or one of {}", flags.init,
                              fmt::join(words, ", ")));
    config.init.from = InitFrom::file;
    config.init.file = std::filesystem::absolute(flags.init).lexically_normal().string();
  }
  if (flags.undrawable == Undrawable::refused) config.init.strict = true;
  const std::string layout = flags.cameras.empty() ? "" : layout_of(config.scene.path);
  if (!layout.empty() && !takes_cameras(layout))
    throw Error(
        fmt::format("--cameras {}: {} has its own cameras ({}), so these would be ignored; the "
                    "option is for a video or numbered images",
                    flags.cameras, config.scene.path, layout));
  if (!flags.cameras.empty())
    config.scene.cameras = std::filesystem::absolute(flags.cameras).lexically_normal().string();
  if (flags.still) config.scene.still = true;
  make_paths_absolute(config.metrics);
  if (command.count("--iterations")) config.train.iterations = flags.iterations;
  if (command.count("--resolution")) config.scene.resolution = flags.resolution;
  if (command.count("--save-every")) config.train.save_every = flags.save_every;
  if (command.count("--seed")) config.train.seed = flags.seed;
  check(config);
  return config;
}

// The viewer beside a training. It uses a queue of its own where it needs the device.
class TrainingView {
 public:
  TrainingView(const TrainFlags& flags, const TrainOptions& config, const GlobalOptions& options)
      : device_([options] { return std::unique_ptr<Queue>(new Queue(open_queue(options))); }) {
    std::vector<std::unique_ptr<ViewSource>> sources;
    sources.push_back(std::make_unique<ViewSource>(flags.run, config, live_, device_));
    server_ = std::make_unique<ViewServer>(std::move(sources), flags.server);
    browser_ = announce(*server_, flags.server, flags.open);
  }
  ~TrainingView() { live_->end(); }  // before the server waits for its answers
  TrainObserver* observer() { return live_.get(); }

 private:
  std::shared_ptr<LiveModel> live_ = std::make_shared<LiveModel>();
  ViewDevice device_;
  std::unique_ptr<ViewServer> server_;
  std::unique_ptr<RunningProgram> browser_;
};

// The devices of this process, each but the first with a thread that follows the leader.
class Followers {
 public:
  Followers(Team& team, std::vector<std::unique_ptr<Queue>> queues)
      : team_(team), queues_(std::move(queues)) {
    for (size_t i = 0; i < queues_.size(); ++i)
      threads_.emplace_back([this, i] { follow(team_.seat(i + 1), *queues_[i]); });
  }
  // Waits for them; the seat of the first device has ended or failed.
  ~Followers() {
    for (std::thread& thread : threads_) thread.join();
  }
  Followers(const Followers&) = delete;
  Followers& operator=(const Followers&) = delete;

 private:
  Team& team_;
  std::vector<std::unique_ptr<Queue>> queues_;
  std::vector<std::thread> threads_;
};

// Ends the training of the others, however that of the leader ends.
struct EndOfSeat {
  ~EndOfSeat() { seat->end(); }
  Seat* seat;
};

void train_on(Queue& queue, Seat* seat, const TrainFlags& flags, const TrainOptions& config,
              const GlobalOptions& options);

// The devices of --devices, or the one of --device.
std::vector<std::unique_ptr<Queue>> open_queues(const TrainFlags& flags,
                                                const GlobalOptions& options) {
  std::vector<std::unique_ptr<Queue>> queues;
  for (size_t i = 0; i < std::max<size_t>(flags.devices.size(), 1); ++i) {
    GlobalOptions device = options;
    if (!flags.devices.empty()) device.device = flags.devices[i];
    queues.emplace_back(new Queue(open_queue(device)));
  }
  return queues;
}

// As train_on(), by several devices of this process, of several ranks, or both. The leader's rank
// reports all failures.
void train_together(const TrainFlags& flags, const CLI::App& command,
                    const GlobalOptions& options) {
  Ranks ranks;
  ProcessPlace place;
  if (ranks.count() > 1)
    place = {size_t(ranks.rank()), ranks.machine(),
             [&ranks](const std::string& message) { return ranks.gather(message); }};
  const bool leads = ranks.rank() == 0;
  std::optional<WarningsTo> silence;
  if (!leads) silence.emplace([](const std::string&) {});
  std::vector<std::unique_ptr<Queue>> queues;
  std::exception_ptr failure;
  std::string sentence;
  try {
    queues = open_queues(flags, options);
  } catch (const std::exception& problem) {
    failure = std::current_exception();
    sentence = problem.what();
  }
  Team team(std::max<size_t>(queues.size(), 1), place);
  Seat& seat = team.seat(0);
  if (failure) {
    seat.fail(sentence);
    if (leads) std::rethrow_exception(failure);
    return;
  }
  const std::unique_ptr<Queue> first = std::move(queues.front());
  queues.erase(queues.begin());
  const Followers followers(team, std::move(queues));
  const EndOfSeat end_of_seat{&seat};
  if (leads)
    train_on(*first, &seat, flags, configured(flags, command), options);
  else
    follow(seat, *first);
}

void run_train(const TrainFlags& flags, const GlobalOptions& options, const CLI::App& command) {
  if (flags.devices.size() > 1 || Ranks::announced() > 1)
    return train_together(flags, command, options);
  TrainOptions config = configured(flags, command);
  GlobalOptions device = options;
  if (!flags.devices.empty()) device.device = flags.devices.front();
  if (device.device.empty()) device.device = config.train.device;
  const CompileAhead ahead(device.device, config);
  QueueOptions queue_options;
  queue_options.profile = flags.profile;
  Queue queue = open_queue(device, queue_options);
  train_on(queue, nullptr, flags, config, device);
}

// seat: of the leader of several devices; nullptr: this device trains alone.
void train_on(Queue& queue, Seat* seat, const TrainFlags& flags, const TrainOptions& settings,
              const GlobalOptions& options) {
  TrainOptions config = settings;
  const RunFolder run(flags.run);
  std::optional<CameraMethod> method;
  if (!flags.method.empty()) method = value_named<CameraMethod>(flags.method);
  find_cameras_of_video(config, run, method, flags.resume, options.quiet);
  TrainExtensions extensions;
  std::unique_ptr<TrainingView> view;
  if (flags.view) view = std::make_unique<TrainingView>(flags, config, options);
  report::RecordedNotices notices(view ? view->observer() : nullptr);
  extensions.observer = &notices;
  extensions.seat = seat;
  const std::vector<std::string> before =
      flags.resume ? report::read_notices(run) : std::vector<std::string>();
  for (const std::string& sentence : before) notices.add(sentence);
  const Evaluation evaluation = [&] {
    const Start start = flags.resume      ? Start::resume
                        : flags.overwrite ? Start::overwrite
                                          : Start::fresh;
    try {
      return train_run(queue, config, run, options.quiet, start, extensions);
    } catch (const Interrupted&) {
      if (RunFolder::is_run(run.folder())) report::write_notices(run, notices.sentences());
      throw;
    }
  }();
  report::write_notices(run, notices.sentences());
  print_report(evaluation, run.read_facts());
  print_result("model     {}\n", run.model_path(run.models().at(0)));
  const bool tested = std::filesystem::exists(run.path("results.json"));
  if (tested)
    print_result("metrics   {}, {}\n", run.path("results.json"), run.path("per_view.json"));
  else
    print_result(
        "The scene has no test views; `gflow eval {} --split train` evaluates all "
        "training views\n",
        run.folder());
  const std::string report = report::write_run_report(
      queue, run, evaluation, tested ? "test" : "train", version_text(), notices.sentences());
  if (!report.empty()) print_result("report    {}\n", report);
  if (view)
    print_result("view      `gflow view {}`: the viewer of the training has ended\n", run.folder());
  if (flags.profile) print_timings(queue);
}

}  // namespace

void add_train(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* command = app.add_subcommand(
      "train", "Train a moving splat from the cameras and images of a scene, and evaluate it");
  command
      ->add_option("SCENE", flags->scene,
                   "Folder of the scene (N3V, Panoptic, nerfies, Consistent4D, D-NeRF/Blender, "
                   "nerfstudio, COLMAP, numbered images), or a video file; optional with --resume")
      ->check(path_given())
      ->type_name("PATH");
  command->add_option("-o,--output", flags->run, "Output run folder")
      ->check(path_given())
      ->required()
      ->type_name("FOLDER");
  command
      ->add_option(
          "--quality", flags->quality,
          "How long to train: draft, about a minute on two cores; standard, about a quarter "
          "of an hour; best, three times as long. --config, --set and --iterations override it")
      ->check(choice_of({kQualities.begin(), kQualities.end()}))
      ->default_str("standard")
      ->type_name("WORD");
  command->add_option("--config", flags->config_file, "Settings in a TOML file (default: none)")
      ->check(path_given())
      ->type_name("FILE.toml");
  command
      ->add_option("--set", flags->settings,
                   "One setting, e.g. --set flow.weight=0.2; may be repeated. The config.toml of "
                   "any run documents all settings")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command
      ->add_option(
          "--init", flags->init,
          "Initial Gaussians: auto, points, stereo, random, visual-hull or file (init.from), or a "
          "static splat file: .ply, compressed .ply, .splat, .spz (init.file)")
      ->type_name("FILE|WORD");
  add_strict(*command, flags->undrawable);
  command
      ->add_option("--cameras", flags->cameras,
                   "Camera of a video or of numbered images, or one camera per image: cameras.json "
                   "or transforms.json (scene.cameras)")
      ->type_name("FILE");
  command->add_flag("--still", flags->still,
                    "The camera of a video stands still, even where most of the image moves "
                    "(scene.still); otherwise poses of a camera that moves are found first");
  command
      ->add_option("--method", flags->method,
                   "How the poses of a video are found, as in gflow cameras: tracks, or colmap, "
                   "also for photographs in any order. The camera counts as one that moves")
      ->check(choice_of({"tracks", "colmap"}))
      ->default_str("tracks")
      ->type_name("WORD");
  const TrainOptions defaults;
  constexpr double most = std::numeric_limits<int>::max();
  command->add_option("--iterations", flags->iterations, "Training steps (train.iterations)")
      ->check(training_steps())
      ->default_str(std::to_string(defaults.train.iterations));
  command
      ->add_option("-r,--resolution", flags->resolution,
                   "Divisor of the image width and height: 1, 2, 4 or 8 (scene.resolution)")
      ->check(choice_of({"1", "2", "4", "8"}))
      ->default_str(std::to_string(defaults.scene.resolution));
  command->add_option("--seed", flags->seed, "Seed of all random choices (train.seed)")
      ->check(number_in(0, double(kGreatestSeed)))
      ->default_str(std::to_string(defaults.train.seed));
  command
      ->add_option("--save-every", flags->save_every,
                   "Steps between two point clouds (train.save_every); 0: only the last")
      ->check(number_in(0, most))
      ->default_str(std::to_string(defaults.train.save_every));
  command->add_flag("--resume", flags->resume,
                    "Continue the run in the output folder from its last checkpoint, with its "
                    "settings; start it if there is none");
  command
      ->add_flag("--overwrite", flags->overwrite,
                 "Start again if the output folder contains a run, finished or stopped")
      ->excludes("--resume");
  command->add_flag("--allow-command", flags->allow_command,
                    "Start the program given by guidance.command in a file: in --config, or in the "
                    "run that is resumed");
  command->add_flag("--view", flags->view,
                    "Show the training in a browser, at the address that is printed");
  add_server_options(*command, flags->server, flags->open, " of --view");
  command
      ->add_option("--devices", flags->devices,
                   "Train on several devices, e.g. 0,1: each renders its share of the views of a "
                   "batch (train.batch). mpirun adds those of other processes and machines")
      ->delimiter(',')
      ->check(list_entry())
      ->type_name("INDEX|NAME,...")
      ->default_str("");
  command->add_flag("--profile", flags->profile, "Print the time of each kernel");
  command->callback([flags, &options, command] { run_train(*flags, options, *command); });
}

}  // namespace gflow
