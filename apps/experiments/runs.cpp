// SPDX-License-Identifier: Apache-2.0
#include "apps/experiments/runs.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <numeric>
#include <thread>
#include <tuple>
#include <utility>

#include "apps/experiments/metrics.hpp"
#include "optim/eval/metric_networks.hpp"
#include "optim/runs/run_folder.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/modest_json.hpp"
#include "runtime/files/text_file.hpp"

extern char** environ;

namespace gflow::experiments {
namespace {

namespace fs = std::filesystem;

// A sentence about the first setting that differs; empty if none does.
std::string difference(const TrainOptions& before, const TrainOptions& now) {
  const auto a = setting_values(before), b = setting_values(now);
  for (const auto& [key, value] : b)
    if (a.at(key) != value) return fmt::format("{} was {}, now it is {}", key, a.at(key), value);
  return "";
}

// Whether the settings name a network other than the one that evaluated the run.
bool needs_other_networks(MetricsOptions wanted, const RunFolder& run) {
  make_paths_absolute(wanted);
  const MetricsOptions used = run.metrics_options();
  return (!wanted.lpips.empty() && wanted.lpips != used.lpips) ||
         (!wanted.clip.empty() && wanted.clip != used.clip);
}

// The last complete line of a file; "" if there is none.
std::string last_line(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) return "";
  const auto size = in.tellg();
  const std::streamoff length = std::min<std::streamoff>(size, 4096);
  in.seekg(-length, std::ios::end);
  std::string tail(size_t(length), '\0');
  in.read(tail.data(), length);
  while (!tail.empty() && (tail.back() == '\n' || tail.back() == '\r')) tail.pop_back();
  return tail.substr(tail.rfind('\n') + 1);
}

// The error message of a training: the last line that begins with the program's name.
std::string reason(const std::string& log) {
  std::ifstream in(log);
  std::string found, begin = "gflow: ";
  for (std::string line; std::getline(in, line);)
    if (line.rfind(begin, 0) == 0) found = line.substr(begin.size());
  if (found.empty()) found = last_line(log);
  return found.empty() ? "it printed nothing; the disk may be full" : found;
}

// Training time over all parts of an interrupted run.
double train_seconds(const std::string& results) {
  return member_or(read_json(results), "train_seconds", std::nan(""));
}

// Reuses computed flow and unpacked frames of an earlier run of the same scene; training checks
// their stamp. Hard links suffice: these files are replaced, never modified.
void share_caches(const std::string& from, const std::string& to) {
  std::error_code none;  // whatever cannot be linked is computed again
  // The stamp first, so that the folder is always recognised as one of training; each file is
  // complete.
  fs::create_directories(to, none);
  fs::copy_file(from + "/caches.stamp", to + "/caches.stamp", fs::copy_options::skip_existing,
                none);
  const std::string stamp = read_report_or_empty(from + "/caches.stamp");
  if (stamp.empty() || stamp != read_report_or_empty(to + "/caches.stamp")) return;
  for (const char* name : {"flow", "frames"})
    for (const auto& entry : fs::recursive_directory_iterator(from + "/" + name, none)) {
      const fs::path link = to / fs::relative(entry.path(), from);
      fs::create_directories(link.parent_path(), none);
      if (entry.is_regular_file()) fs::create_hard_link(entry.path(), link, none);
    }
}

// Whether two trainings use the same images at the same time steps, so that they can share flow.
// Flow files are named by image, not by content.
bool same_images(const TrainOptions& a, const TrainOptions& b) {
  const auto of_a = setting_values(a), of_b = setting_values(b);
  return std::all_of(of_a.begin(), of_a.end(), [&](const auto& setting) {
    return setting.first.rfind("scene.", 0) != 0 || of_b.at(setting.first) == setting.second;
  });
}

// Step and training time [s] in the last line of a training's log.
std::pair<int, double> steps_made(const std::string& run) {
  const auto line = nlohmann::json::parse(last_line(run + "/metrics.jsonl"), nullptr, false);
  return {member_or(line, "iteration", 0), member_or(line, "seconds", std::nan(""))};
}

// Whether another process trains there, such as one left behind by a killed gflow.
bool is_being_trained(const std::string& run) {
  return fs::is_directory(run) && !RunFolder(run).lock_if_free();
}

// Estimated seconds per step if no run has measured it: 10 ms for 256 x 192 pixels and 30 000
// Gaussians with flow on two cores with AVX-512 (PoCL). Other devices or motion models may be
// several times faster or slower. NaN if the scene cannot be read.
double guessed_step(const SceneOptions& config) try {
  const Scene scene = read_scene(config.path, config);
  double pixels = 0;
  for (const Camera& camera : scene.cameras)
    pixels += double(camera.width) * camera.height / double(scene.cameras.size());
  const double cores = std::max(1u, std::thread::hardware_concurrency());
  return 4e-7 * pixels / double(config.resolution * config.resolution) / cores;
} catch (const Error&) {
  return std::nan("");
}

// A training in a child process.
class Training {
 public:
  Training(const PlannedRun& run, const std::string& folder, const std::string& device,
           bool allow_command) {
    const RunFiles files(folder, run.id);
    write_file_atomically(files.settings, to_toml(run.config));
    std::vector<std::string> arguments{"gflow",        "train",   run.config.scene.path,
                                       "-o",           files.run, "--config",
                                       files.settings, "--quiet", "--resume"};
    if (!device.empty()) arguments.insert(arguments.end(), {"--device", device});
    if (allow_command) arguments.push_back("--allow-command");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, files.log.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    // Its own process group: Ctrl-C at the terminal reaches this program only, which stops its
    // trainings once. A second signal would end them without saving.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    const int problem =
        posix_spawn(&pid_, "/proc/self/exe", &actions, &attributes, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (problem != 0)
      throw Error(fmt::format("cannot start the training {}: {}", run.id, std::strerror(problem)));
  }
  // Whether the process has ended; failed() reports the result.
  bool ended() {
    if (!ended_) ended_ = waitpid(pid_, &status_, WNOHANG) == pid_;
    return ended_;
  }
  void wait() {
    if (!ended_) waitpid(pid_, &status_, 0);
    ended_ = true;
  }
  bool failed() const { return !WIFEXITED(status_) || WEXITSTATUS(status_) != 0; }
  void stop() const { kill(pid_, SIGINT); }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

class Pool {
 public:
  Pool(const Plan& plan, const std::string& folder, const RunOptions& options)
      : plan_(plan), folder_(folder), options_(options) {
    for (size_t i = 0; i < plan.runs.size(); ++i) {
      const Standing standing = standing_of(plan.runs[i], folder);
      steps_.push_back(standing.steps);
      const bool other = standing.status == Status::other_settings;
      if (other && !options.redo)
        throw Error(
            fmt::format("the experiment has changed since {} was trained: {}; retrain such runs "
                        "with --redo, or keep them by choosing another folder with -o",
                        RunFiles(folder, plan.runs[i].id).run, standing.difference));
      if (other) steps_[i] = 0;
      has_ended_.push_back(standing.status == Status::finished);
      if (standing.status != Status::finished) waiting_.push_back({i, other});
    }
    progress_ = std::make_unique<Progress>("runs", total_steps(plan), options.quiet, steps_done());
  }

  ~Pool() {  // processes left running after an error
    for (auto& [i, job] : running_) job.training.stop();
    for (auto& [i, job] : running_) job.training.wait();
  }

  void train() {
    const InterruptGuard guard;
    share_cores(options_.jobs);
    while (!running_.empty() || (!waiting_.empty() && !interrupted())) {
      start_more();
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      if (interrupted() && !told_to_stop_) stop_all();
      look();
    }
    progress_->finish();
    if (interrupted())
      throw Interrupted(
          fmt::format("stopped with {} of {} runs finished; run the same command again to continue",
                      finished(), plan_.runs.size()));
    if (failures_.empty()) return;
    throw RunsFailed(fmt::format("{} of {} runs failed; the first error, from {}: {}",
                                 failures_.size(), plan_.runs.size(),
                                 RunFiles(folder_, plan_.runs[failures_[0]].id).log,
                                 reason(RunFiles(folder_, plan_.runs[failures_[0]].id).log)));
  }

 private:
  static long total_steps(const Plan& plan) {
    long steps = 0;
    for (const PlannedRun& run : plan.runs) steps += run.config.train.iterations;
    return steps;
  }
  long steps_done() const { return std::accumulate(steps_.begin(), steps_.end(), 0L); }
  size_t finished() const {
    return plan_.runs.size() - waiting_.size() - running_.size() - failures_.size() - stopped_;
  }

  // Parallel trainings share the cores. Otherwise PoCL would use all cores for each training and
  // wait for the slowest thread at every kernel. Two busy cores, n3v-baton: 19 steps/s in one
  // training with two threads, 60 in two with one thread each. The number of threads does not
  // change any result.
  static void share_cores(int jobs) {
    const int cores = std::max(1, int(std::thread::hardware_concurrency()));
    if (jobs > 1)
      ::setenv("POCL_MAX_PTHREAD_COUNT", std::to_string(std::max(1, cores / jobs)).c_str(), 0);
  }

  void start_more() {
    while (!waiting_.empty() && int(running_.size()) < options_.jobs && !interrupted()) {
      const auto next = std::find_if(waiting_.begin(), waiting_.end(), [&](const auto& run) {
        return !is_being_trained(RunFiles(folder_, plan_.runs[run.first].id).run);
      });
      if (next == waiting_.end()) {
        if (running_.empty() && !std::exchange(told_to_wait_, true))
          progress_->print_line(
              fmt::format("gflow: another process is training {}: waiting for it to finish",
                          plan_.runs[waiting_[0].first].id));
        return;
      }
      const auto [i, starts_over] = *next;
      // The device with the fewest trainings.
      std::vector<std::string> devices = options_.devices;
      if (devices.empty()) devices.push_back("");
      const auto taken = [&](const std::string& device) {
        return std::count_if(running_.begin(), running_.end(),
                             [&](const auto& entry) { return entry.second.device == device; });
      };
      const std::string device = *std::min_element(
          devices.begin(), devices.end(),
          [&](const std::string& a, const std::string& b) { return taken(a) < taken(b); });
      waiting_.erase(next);
      const std::string run = RunFiles(folder_, plan_.runs[i].id).run;
      // Removed before the new settings are written: a training that is stopped early must not
      // leave the results of the previous run beside them.
      if (starts_over) fs::remove_all(run);
      // Under a time limit every run computes its own caches.
      const bool fresh = !fs::exists(run) && plan_.runs[i].config.train.minutes == 0;
      for (size_t other = 0; fresh && other < plan_.runs.size(); ++other)
        if (has_ended_[other] && same_images(plan_.runs[other].config, plan_.runs[i].config))
          share_caches(RunFiles(folder_, plan_.runs[other].id).run, run);
      running_.emplace(
          i, Job{Training(plan_.runs[i], folder_, device, options_.allow_command), device});
    }
  }

  void stop_all() {
    told_to_stop_ = true;
    for (auto& [i, job] : running_) job.training.stop();
  }

  void look() {
    for (auto entry = running_.begin(); entry != running_.end();) {
      const size_t i = entry->first;
      const PlannedRun& run = plan_.runs[i];
      steps_[i] = std::max(steps_[i], steps_made(RunFiles(folder_, run.id).run).first);
      if (!entry->second.training.ended()) {
        ++entry;
        continue;
      }
      has_ended_[i] = !entry->second.training.failed();
      if (has_ended_[i])
        steps_[i] = run.config.train.iterations;
      else if (interrupted())
        ++stopped_;
      else
        fail(i);
      entry = running_.erase(entry);
    }
    progress_->update(steps_done(),
                      {{"finished", fmt::format("{}/{}", finished(), plan_.runs.size())},
                       {"running", fmt::format("{}", running_.size())}});
  }

  void fail(size_t i) {
    failures_.push_back(i);
    const RunFiles files(folder_, plan_.runs[i].id);
    progress_->print_line(fmt::format("{} failed: {}", plan_.runs[i].id, reason(files.log)));
  }

  struct Job {
    Training training;
    std::string device;
  };

  const Plan& plan_;
  std::string folder_;
  RunOptions options_;
  std::unique_ptr<Progress> progress_;
  std::vector<bool> has_ended_;                   // of each run: whether it succeeded
  std::vector<int> steps_;                        // of each run
  std::vector<std::pair<size_t, bool>> waiting_;  // run, and whether it starts over; in order
  std::map<size_t, Job> running_;
  std::vector<size_t> failures_;
  size_t stopped_ = 0;
  bool told_to_stop_ = false, told_to_wait_ = false;
};

}  // namespace

void require_no_other_tables(const std::string& folder) {
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder + "/runs", none))
    if (entry.path().extension() == ".toml") return;
  for (const char* name :
       {"table.md", "table.csv", "table.json", "costs.md", "runs.csv", "plots", "pictures"})
    if (fs::exists(folder + "/" + name))
      throw Error(
          fmt::format("writing an experiment into {0}: it would overwrite {0}/{1}, which is not "
                      "from an experiment; choose a new folder or that of an earlier experiment",
                      folder, name));
}

Standing standing_of(const PlannedRun& run, const std::string& folder) {
  const RunFiles files(folder, run.id);
  Standing standing;
  if (!fs::exists(files.settings) || !RunFolder::is_run(files.run)) return standing;
  const RunFacts facts = RunFolder(files.run).read_facts();
  // A run whose results are lost or damaged is evaluated again, like an interrupted one.
  const std::string results = read_report_or_empty(files.run + "/results.json");
  const bool finished = facts.finished && parse_json_within_limits(results).is_object();
  std::tie(standing.steps, standing.seconds) = steps_made(files.run);
  if (finished) {
    standing.steps = run.config.train.iterations;
    standing.seconds = train_seconds(files.run + "/results.json");
  }
  standing.status = finished ? Status::finished : Status::stopped;
  TrainOptions before;
  apply_file(before, files.settings);
  // Resuming a finished training evaluates it again.
  if (finished && needs_other_networks(run.config.metrics, RunFolder(files.run)))
    standing.status = Status::stopped;
  before.metrics = run.config.metrics;
  standing.difference = difference(before, run.config);
  if (!standing.difference.empty()) standing.status = Status::other_settings;
  return standing;
}

TimeLeft time_left(const Plan& plan, const std::vector<Standing>& standings) {
  // Seconds per step over the runs of a scene, or over all.
  const auto pace = [&](const std::string& scene) {
    double seconds = 0, steps = 0;
    for (size_t i = 0; i < plan.runs.size(); ++i)
      if (standings[i].status != Status::other_settings && standings[i].steps > 0 &&
          !std::isnan(standings[i].seconds) &&
          (scene.empty() || plan.rows[plan.runs[i].row].scene == scene)) {
        seconds += standings[i].seconds;
        steps += standings[i].steps;
      }
    return steps > 0 ? seconds / steps : std::nan("");
  };
  TimeLeft time{{}, std::isnan(pace(""))};
  std::map<std::string, double> guesses;  // by scene
  for (size_t i = 0; i < plan.runs.size(); ++i) {
    const int steps = standings[i].status == Status::other_settings ? 0 : standings[i].steps;
    double each = pace(plan.rows[plan.runs[i].row].scene);
    if (std::isnan(each)) each = pace("");
    if (time.guessed) {
      const std::string& scene = plan.rows[plan.runs[i].row].scene;
      if (!guesses.count(scene)) guesses[scene] = guessed_step(plan.runs[i].config.scene);
      each = guesses[scene];
    }
    const ScheduleOptions& train = plan.runs[i].config.train;
    double seconds = each * double(train.iterations - steps);
    const double most = 60.0 * double(train.minutes);
    if (most > 0 && !(seconds < most)) seconds = most;
    time.left.push_back(standings[i].status == Status::finished ? 0 : seconds);
  }
  return time;
}

void train_all(const Plan& plan, const std::string& folder, const RunOptions& options) {
  fs::create_directories(folder + "/runs");
  Pool(plan, folder, options).train();
}

}  // namespace gflow::experiments
