// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_state.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>

#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// File of a state.
struct Place {
  int iteration;
  bool checkpoint;
  std::string path;
};

// Newest first.
std::vector<Place> places_in(const RunFolder& run) {
  std::vector<Place> places;
  for (const int iteration : run.models())
    places.push_back({iteration, false, run.model_path(iteration)});
  const CheckpointFolder checkpoints = run.checkpoints();
  for (const int step : checkpoints.steps()) places.push_back({step, true, checkpoints.path(step)});
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.iteration > b.iteration; });
  return places;
}

// Facts about training up to the iteration: all if it ended or was interrupted there, some if there
// is a checkpoint.
RunFacts facts_at(const RunFolder& run, int iteration) {
  const RunFacts last = run.read_facts();
  if (last.iterations == iteration) return last;
  RunFacts facts;
  facts.iterations = iteration;
  facts.train_seconds = facts.peak_memory_mib = unknown;
  try {
    const CheckpointFacts kept = read_checkpoint_facts(run.checkpoints().path(iteration));
    facts.train_seconds = kept.seconds;
    facts.device = kept.device;
  } catch (const Error&) {  // missing or damaged
  }
  return facts;
}

RunState read_place(const RunFolder& run, const Place& place) {
  RunState state;
  state.iteration = place.iteration;
  state.checkpoint = place.checkpoint;
  state.path = place.path;
  std::error_code gone;  // on failure, reading the file reports the error
  state.bytes = fs::file_size(place.path, gone);
  if (place.checkpoint) {
    const Checkpoint checkpoint = read_checkpoint(place.path);
    state.model =
        model_of_state(kept_shape(checkpoint, place.path, run), checkpoint.arrays, place.path);
  } else {
    state.model = read_model(place.path);
  }
  const MotionModelKind motion = state.model.shape.motion;
  state.facts = facts_at(run, place.iteration);
  state.facts.motion = name_of(motion);
  return state;
}

// The first readable state; none if a file vanished meanwhile because training replaced it.
std::optional<RunState> first_readable(const RunFolder& run, const std::vector<Place>& places) {
  std::string reason;
  for (const Place& place : places) {
    if (!reason.empty()) warn(fmt::format("{}; reading {} instead", reason, place.path));
    try {
      return read_place(run, place);
    } catch (const Error& problem) {
      if (!fs::exists(place.path)) return std::nullopt;
      reason = problem.what();
    }
  }
  throw Error(reason);
}

}  // namespace

ModelShape kept_shape(const Checkpoint& checkpoint, const std::string& path, const RunFolder& run) {
  if (checkpoint.facts.shape) return *checkpoint.facts.shape;
  try {
    return read_model(run.path("input.ply")).shape;
  } catch (const Error& problem) {
    throw Error(
        fmt::format("{} was written by an older gflow and cannot be read without the initial "
                    "Gaussians of the run: {}",
                    path, problem.what()));
  }
}

std::string RunState::text() const {
  return fmt::format("iteration {} of {}, from {}", iteration, config.train.iterations,
                     checkpoint ? "the checkpoint" : "its point cloud");
}

std::vector<int> iterations_of(const RunFolder& run) {
  std::vector<int> iterations;
  for (const Place& place : places_in(run)) iterations.push_back(place.iteration);
  std::reverse(iterations.begin(), iterations.end());
  iterations.erase(std::unique(iterations.begin(), iterations.end()), iterations.end());
  return iterations;
}

RunState read_run_state(const RunFolder& run, int iteration) {
  constexpr int attempts = 10;  // each meets another checkpoint
  for (int attempt = 0; attempt < attempts; ++attempt) {
    std::vector<Place> places = places_in(run);
    if (places.empty())
      throw Error(
          fmt::format("run folder {} has no model yet: training saves the first one after "
                      "train.checkpoint_every or train.save_every steps, or at its end",
                      run.folder()));
    if (iteration != latest_iteration) {
      const auto other = [&](const Place& place) { return place.iteration != iteration; };
      places.erase(std::remove_if(places.begin(), places.end(), other), places.end());
      if (places.empty())
        throw Error(fmt::format("run folder {} has no model of iteration {}; available: {}",
                                run.folder(), iteration, fmt::join(iterations_of(run), ", ")));
    }
    if (std::optional<RunState> state = first_readable(run, places)) {
      state->config = run.read_config();
      return *std::move(state);
    }
  }
  throw Error(
      fmt::format("the models of run folder {} are removed while being read", run.folder()));
}

}  // namespace gflow
