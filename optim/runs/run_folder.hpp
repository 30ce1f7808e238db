// SPDX-License-Identifier: Apache-2.0
// Layout and replacement of a run folder: config.toml, cameras.json, metrics.jsonl and .csv, the
// model under point_cloud/iteration_N, checkpoints, results.json and per_view.json. Each file
// appears complete or not at all.
#pragma once
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "optim/eval/evaluation.hpp"
#include "optim/runs/checkpoint.hpp"
#include "optim/train/trainer.hpp"
#include "runtime/files/file_lock.hpp"

namespace gflow {

// Facts about a run, stored in results.json besides the metrics.
struct RunFacts {
  int iterations = 0;  // steps made
  double train_seconds = 0;
  double peak_memory_mib = 0;  // of the process that trained it, or the last one that resumed it
  std::string device;
  std::string motion;     // name of the motion model
  bool finished = false;  // ended regularly, not interrupted
};

class RunFolder {
 public:
  // The folder need not exist yet.
  explicit RunFolder(std::string folder) : folder_(std::move(folder)) {}
  // Whether the folder is a run: it has a config.toml, or a checkpoint, which contains one.
  static bool is_run(const std::string& path);
  // Throws FileIsLocked while another process trains there and has not written its settings yet.
  static void require_no_pending_replacement(const std::string& path);
  // Opens an existing run and completes a pending replacement, left by a process that was killed;
  // warns if that fails. Error if there is no run.
  static RunFolder open(const std::string& path);

  // Creates the folder. Error if it cannot be made, or if it contains something and no training
  // made it.
  void make() const;
  static RunFolder create(const std::string& path);  // RunFolder(path).make()
  // Locks the folder: while the result lives no other process writes it. Error if another one does
  // already.
  FileLock lock() const;
  // The same, but null if another process holds the lock.
  std::unique_ptr<FileLock> lock_if_free() const;

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  const std::string& folder() const { return folder_; }
  CheckpointFolder checkpoints() const { return CheckpointFolder(path("checkpoints")); }
  std::string model_path(int iteration) const;
  // Iterations with a point_cloud/iteration_N, descending. Which model of a run is shown:
  // optim/runs/run_state.hpp.
  std::vector<int> models() const;
  // Writes the model of an iteration. Error if it cannot.
  void write_model(int iteration, const HostModel& model) const;
  // Removes the model of an iteration, if there is one.
  void remove_model(int iteration) const;
  // Checks the run's subfolders before training. Error if one cannot be read, or is a broken link:
  // it would seem empty, or could not be written.
  void require_its_folders() const;
  // Paths of the previous run's files for resuming or showing it: checkpoints, models, metrics,
  // input.ply, training.json. training.json is first, because it marks a finished run.
  std::vector<std::string> training() const;
  // Whether training here may remove or replace this file or folder, as part of the run, its
  // results or its caches; links are followed. False for "".
  bool would_remove(const std::string& file) const;
  // Paths of results and per-view metrics of all splits and iterations, compare.png, report.html
  // and test/.
  std::vector<std::string> results() const;
  void remove_results() const;
  // Whether the folder holds output of a training: a checkpoint, a model, training.json or results.
  bool holds_training() const;
  // Removes unfinished files of killed processes in the places where training writes. Other
  // commands may be writing elsewhere in the folder meanwhile.
  void forget_unfinished_files() const;
  // Removes cached flow and video frames unless they have the same stamp; of a link only itself.
  void remove_stale_caches(const std::string& stamp) const;
  // Whether the caches have this stamp.
  bool has_caches_of(const std::string& stamp) const;

  void write_config(const TrainOptions& config) const;
  // Settings of config.toml, completed from the last checkpoint; those of the checkpoint alone,
  // with a warning, if config.toml is missing or damaged. Error if there is neither.
  TrainOptions read_config() const;
  // cameras.json, with what training has corrected; near: the near plane of all cameras [scene
  // units].
  void write_cameras(const FrameStore& frames, float near) const;
  // Gives the frames of the run's scene the cameras of cameras.json. Error if they are others.
  void move_cameras(FrameStore& frames) const;
  // Parses a line of metrics.jsonl; a discarded value if it is invalid or longer than 64 kB.
  static nlohmann::ordered_json metrics_of(std::string_view line);
  // Appends a line to metrics.jsonl, and the same values to metrics.csv.
  void append_metrics(int iteration, double seconds, const StepReport& report) const;
  // Removes the lines of this and later iterations, and rewrites metrics.csv from the rest of
  // metrics.jsonl, because the last lines of a killed process may be cut off or missing. Warns of
  // other invalid lines.
  void keep_metrics_before(int iteration) const;
  // Writes results.json and per_view.json for the test views, results_SPLIT.json and so on for
  // others; results[_SPLIT]_iteration_N.json unless it is the run's latest model. Unknown facts
  // (NaN) become null. Call it last: experiments take results.json as the sign of a finished run.
  // Returns both paths.
  std::vector<std::string> write_results(const Evaluation& evaluation, const std::string& split,
                                         const RunFacts& facts, const TrainOptions& config,
                                         size_t gaussians, bool latest = true) const;
  // The networks that evaluated results.json; none if there is no such file.
  MetricsOptions metrics_options() const;
  // Facts of the last training, for a later evaluation. Zeros if there was none, or, with a
  // warning, if the file is damaged, because model and checkpoints do not need it. Error if the
  // file exists and cannot be read.
  RunFacts read_facts() const;
  void write_facts(const RunFacts& facts) const;

 private:
  std::string folder_;
};

}  // namespace gflow
