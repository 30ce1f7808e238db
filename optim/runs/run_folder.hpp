// SPDX-License-Identifier: Apache-2.0
// What a run leaves behind, and where: config.toml, cameras.json, metrics.jsonl and .csv, the model
// under point_cloud/iteration_N, checkpoints, results.json and per_view.json. Each file appears
// complete or not at all.
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

// Facts about a run that results.json names beside the figures.
struct RunFacts {
  int iterations = 0;  // steps made
  double train_seconds = 0;
  double peak_memory_mib = 0;  // of the process that trained it, or the last one that went on
  std::string device;
  std::string motion;     // name of the motion model
  bool finished = false;  // it came to its end: was not interrupted
};

class RunFolder {
 public:
  // A folder that need not exist yet.
  explicit RunFolder(std::string folder) : folder_(std::move(folder)) {}
  // Whether there is a run: a config.toml, or a checkpoint, which holds one.
  static bool is_run(const std::string& path);
  // FileIsLocked while another process trains there, which has not come to writing its settings.
  static void require_no_beginning(const std::string& path);
  // An existing run, to which what a killed training had put aside is put back: a warning where
  // that fails. Error when there is none.
  static RunFolder open(const std::string& path);

  // Creates it; Error when it cannot be made, or when it holds something and no training made it.
  void make() const;
  static RunFolder create(const std::string& path);  // both
  // While the result lives no other process writes this folder. Error when one does already.
  FileLock lock() const;
  // The same, but null when one does already.
  std::unique_ptr<FileLock> lock_if_free() const;

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  const std::string& folder() const { return folder_; }
  CheckpointFolder checkpoints() const { return CheckpointFolder(path("checkpoints")); }
  std::string model_path(int iteration) const;
  // Iterations that there is a point_cloud/iteration_N of, falling. Which model of a run is shown:
  // optim/runs/run_state.hpp.
  std::vector<int> models() const;
  // Removes the model of an iteration, if there is one.
  void remove_model(int iteration) const;
  // Error when a folder of it is there and cannot be looked into, or is a link to one that is not:
  // a training would take it for empty, or could not write there; or where flow, frames or test, of
  // which a training removes all, is a link to a folder that is neither empty nor gflow's.
  void require_its_folders() const;
  // Says in the empty folders to which those are links that all in them is gflow's from now on
  // (kOnlyOurs): what is in others is never removed.
  void claim_linked_folders() const;
  // Paths of all that an earlier training is gone on from or shown by: checkpoints, models,
  // metrics, input.ply, training.json; this one first, as it says that there is a finished one.
  std::vector<std::string> training() const;
  // Whether a training here may remove or replace this file, or folder, as one of those or of its
  // results or caches; links are followed. "": no.
  bool would_remove(const std::string& file) const;
  // Paths of results and figures of views, of all splits and iterations, compare.png and test/, or
  // what is in it where it is a link to a folder that is claimed.
  std::vector<std::string> results() const;
  // Whether there is what a training came to: a checkpoint, a model, training.json or results.
  bool holds_training() const;
  // Removes what a killed process had begun to write where trainings write. Others draw elsewhere
  // in the folder, and beside a training.
  void forget_unfinished_files() const;
  // Removes cached flow and video frames unless they were made under the same stamp. Links stay,
  // and what is in a folder elsewhere that is not claimed.
  void remove_stale_caches(const std::string& stamp) const;
  // Whether they were.
  bool has_caches_of(const std::string& stamp) const;

  void write_config(const TrainOptions& config) const;
  // config.toml, and what it does not say from the last checkpoint; that alone, with a warning,
  // where config.toml is missing or damaged. Error when there is neither.
  TrainOptions read_config() const;
  void write_cameras(const Scene& scene) const;
  // What a line of metrics.jsonl says; a discarded value where it is none, or of more than 64 kB.
  static nlohmann::ordered_json metrics_of(std::string_view line);
  // One line of metrics.jsonl, and the same figures in metrics.csv.
  void append_metrics(int iteration, double seconds, const StepReport& report) const;
  // Removes the lines of this iteration and later ones, and writes metrics.csv anew from what stays
  // in metrics.jsonl: the last lines of a killed process may be cut off or missing. Warns of
  // another line that is none.
  void keep_metrics_before(int iteration) const;
  // results.json and per_view.json for the test views, results_SPLIT.json and so on for others;
  // results[_SPLIT]_iteration_N.json unless it is the run's latest model. Facts that are not known
  // (NaN) become null. To be called when all else is there: an experiment takes results.json for
  // the sign that a run is finished. Returns both paths.
  std::vector<std::string> write_results(const Evaluation& evaluation, const std::string& split,
                                         const RunFacts& facts, const TrainOptions& config,
                                         size_t gaussians, bool latest = true) const;
  // The networks that judged results.json; none where there is no such file.
  MetricsOptions judged_by() const;
  // Of the last training, for an evaluation made later; zeros when there was none, or, with a
  // warning, when what says so is damaged: model and checkpoints do without. Error when it is there
  // and cannot be read.
  RunFacts read_facts() const;
  void write_facts(const RunFacts& facts) const;

 private:
  std::string folder_;
};

}  // namespace gflow
