// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include <cmath>
#include <mutex>

#include "apps/common/options.hpp"
#include "apps/python/bind_scenes.hpp"
#include "apps/python/python_objective.hpp"
#include "apps/python/rasterization.hpp"
#include "apps/python/shown_model.hpp"
#include "apps/report/recorded_notices.hpp"
#include "apps/report/write_run_report.hpp"
#include "optim/options/quality.hpp"
#include "optim/runs/train_run.hpp"
#include "optim/runs/video_cameras.hpp"
#include "optim/train/guidance_provider.hpp"
#include "optim/train/train.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

py::dict report_of(const StepReport& report) {
  py::dict terms;
  for (const Term& term : report.terms) terms[term.name.c_str()] = term.value;
  py::dict values;
  values["loss"] = report.loss;
  values["terms"] = terms;
  values["gaussians"] = report.gaussians;
  values["moving"] = report.moving;
  return values;
}

// A training after one of its steps, while its callback runs.
class PyState {
 public:
  PyState(TrainState& state, const TrainOptions& options) : state_(&state), options_(options) {}
  void end() { state_ = nullptr; }

  int step() { return live().done; }
  int steps() { return live().steps; }
  py::dict report() {
    TrainState& state = live();
    const StepReport* report = nullptr;
    {
      const py::gil_scoped_release unlocked;
      report = &state.report();
    }
    return report_of(*report);
  }
  // A copy of the model, which outlives the callback.
  std::shared_ptr<ShownModel> model() {
    TrainState& state = live();
    const py::gil_scoped_release unlocked;
    const float near = near_or_default(options_.render.near, state.trainer.scene());
    return std::make_shared<ShownModel>(state.model().read(state.queue), options_, near);
  }

 private:
  TrainState& live() {
    if (!state_) throw Error("the state of a training can be used inside of its callback only");
    return *state_;
  }

  TrainState* state_;
  const TrainOptions& options_;
};

// Calls the callback, sees Ctrl-C after each step, and hands warnings to Python's.
class PyObserver : public TrainObserver {
 public:
  // Of every `every` steps and the last one. callback: None for none; progress: a bar, or nullptr.
  PyObserver(py::handle callback, int every, const TrainOptions& options, Progress* progress,
             bool keeps_run)
      : callback_(callback),
        every_(every),
        options_(options),
        progress_(progress),
        keeps_run_(keeps_run) {}

  void on_flow(size_t, size_t) override {}
  void on_notice(const std::string& sentence) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    notices_.push_back(sentence);
  }
  bool stop(int) override { return stops_; }

  void after_step(TrainState& state) override {
    if (progress_) progress_->update(state.done, {});
    warn();
    check_interrupt();
    if (callback_.is_none()) return;
    if (state.done % every_ != 0 && state.done != state.steps) return;
    const py::gil_scoped_acquire lock;
    auto shown = std::make_shared<PyState>(state, options_);
    try {
      stops_ = py::cast<bool>(py::bool_(callback_(shown)));
    } catch (...) {
      shown->end();
      if (!keeps_run_) throw;
      failure_ = std::current_exception();  // after the run is saved
      stops_ = true;
    }
    shown->end();
  }

  // Throws what the callback has thrown.
  void rethrow() {
    if (failure_) std::rethrow_exception(failure_);
  }

  // Raises what Python's filters make of the warnings so far.
  void warn() {
    std::vector<std::string> sentences;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      sentences.swap(notices_);
    }
    if (sentences.empty()) return;
    const py::gil_scoped_acquire lock;
    for (const std::string& sentence : sentences)
      if (PyErr_WarnEx(PyExc_RuntimeWarning, sentence.c_str(), 1) != 0)
        throw py::error_already_set();
  }

 private:
  py::handle callback_;
  const int every_;
  const TrainOptions& options_;
  Progress* progress_;
  const bool keeps_run_;  // what fails ends the training as if it asked for that
  bool stops_ = false;
  std::exception_ptr failure_;
  std::mutex mutex_;
  std::vector<std::string> notices_;
};

TrainOptions options_of(const py::dict& arguments, const RunFolder* run, bool resume) {
  TrainOptions options;
  if (resume) {
    RunFolder::require_no_pending_replacement(run->folder());
    if (RunFolder::is_run(run->folder())) options = RunFolder::open(run->folder()).read_config();
    require_no_program(options, run->folder());
  }
  const auto quality = py::cast<std::string>(arguments["quality"]);
  const auto config = py::cast<std::string>(arguments["config"]);
  if (!quality.empty()) apply_quality(options, quality);
  if (!config.empty()) {
    apply_file(options, config);
    require_no_program(options, config);
  }
  apply_settings(options, py::cast<std::vector<std::string>>(arguments["settings"]));
  return options;
}

// A queue of the training's own, so that its callback can render meanwhile.
Queue queue_of(const TrainOptions& options) {
  if (options.train.device.empty()) return Queue(current_device().queue.device);
  GlobalOptions device;
  device.device = options.train.device;
  return open_queue(device);
}

struct Outcome {
  std::shared_ptr<ShownModel> model;
  int steps = 0;
  std::string report;   // path, or empty
  int scene_steps = 0;  // time steps; 0: those of the run's scene
};

Outcome train_in_memory(Scene scene, const TrainOptions& options, PyObserver& observer,
                        std::vector<MakeObjective> objectives) {
  Queue queue = queue_of(options);
  TrainExtensions extensions{&observer, std::move(objectives)};
  const float near = near_or_default(options.render.near, scene);
  const int scene_steps = scene.steps;
  TrainResult result = train(queue, std::move(scene), options, extensions);
  return {std::make_shared<ShownModel>(std::move(result.model), options, near), result.steps, "",
          scene_steps};
}

Outcome train_into(const RunFolder& run, const TrainOptions& options, PyObserver& observer,
                   std::vector<MakeObjective> objectives, Start start, bool quiet) {
  Queue queue = queue_of(options);
  report::RecordedNotices notices(&observer, true);
  if (start == Start::resume)
    for (const std::string& sentence : report::read_notices(run)) notices.add(sentence);
  TrainExtensions extensions{&notices, std::move(objectives)};
  const Evaluation evaluation = [&] {
    try {
      return train_run(queue, options, run, quiet, start, extensions);
    } catch (...) {
      if (RunFolder::is_run(run.folder())) report::write_notices(run, notices.sentences());
      throw;
    }
  }();
  report::write_notices(run, notices.sentences());
  const bool tested = std::filesystem::exists(run.path("results.json"));
  const std::string report =
      report::write_run_report(queue, run, evaluation, tested ? "test" : "train",
                               "gflow " GFLOW_VERSION, notices.sentences());
  Outcome outcome{std::make_shared<ShownModel>(ShownModel::load(run.folder(), latest_iteration)), 0,
                  report, 0};
  outcome.steps = run.read_facts().iterations;
  return outcome;
}

py::dict train_from_python(const py::dict& arguments) {
  const py::object callback = arguments["callback"];
  const int every = py::cast<int>(arguments["every"]);
  const bool resume = py::cast<bool>(arguments["resume"]);
  const bool overwrite = py::cast<bool>(arguments["overwrite"]);
  const bool quiet = py::cast<bool>(arguments["quiet"]);
  const auto folder = py::cast<std::string>(arguments["run"]);
  const RunFolder run(folder);
  TrainOptions options = options_of(arguments, &run, resume);
  std::vector<MakeObjective> objectives;
  const py::list given = arguments["objectives"];  // keeps them alive
  for (const py::handle objective : given) objectives.push_back(python_objective(objective));
  const py::object scene = arguments["scene"];
  std::shared_ptr<PyScene> read;
  if (py::isinstance<PyScene>(scene)) {
    read = py::cast<std::shared_ptr<PyScene>>(scene);
    options.scene = read->options;
    if (!folder.empty() && read->in_memory)
      throw InputError(
          "training on a scene made of arrays: a run folder refers to the scene's folder, and this "
          "one has none; leave `run` out and save the model of the result");
  } else if (const auto path = py::cast<std::string>(scene); !path.empty()) {
    options.scene.path = std::filesystem::absolute(path).lexically_normal().string();
  }
  try {
    check(options);
  } catch (const Error& problem) {
    throw InputError(problem.what());
  }

  Outcome outcome;
  {
    const py::gil_scoped_release unlocked;
    std::unique_ptr<Progress> progress;
    if (folder.empty() && !quiet)
      progress = std::make_unique<Progress>("train", options.train.iterations);
    PyObserver observer(callback, every, options, progress.get(), !folder.empty());
    if (!folder.empty()) {
      find_cameras_of_video(options, run, std::nullopt, resume, quiet);
      outcome = train_into(run, options, observer, std::move(objectives),
                           resume      ? Start::resume
                           : overwrite ? Start::overwrite
                                       : Start::fresh,
                           quiet);
    } else {
      const ScratchFolder scratch("video");
      if (!read) find_cameras_of_video(options, RunFolder(scratch.file("")), {}, false, quiet);
      outcome =
          train_in_memory(read ? read->loaded.scene : read_scene(options.scene.path, options.scene),
                          options, observer, std::move(objectives));
    }
    observer.warn();
    observer.rethrow();
  }
  py::dict result;
  result["model"] = outcome.model;
  result["steps"] = outcome.steps;
  result["report"] = outcome.report;
  result["scene_steps"] = outcome.scene_steps;
  return result;
}

py::list settings() {
  py::list list;
  for (const SettingInWords& setting : settings_in_words(TrainOptions())) {
    py::dict fields;
    fields["name"] = setting.name;
    fields["value"] = setting.value;
    fields["meaning"] = setting.meaning;
    fields["allowed"] = setting.allowed;
    list.append(fields);
  }
  return list;
}

}  // namespace

void bind_training(py::module_& m) {
  py::class_<PyState, std::shared_ptr<PyState>>(m, "TrainState")
      .def_property_readonly("step", &PyState::step)
      .def_property_readonly("steps", &PyState::steps)
      .def("report", &PyState::report)
      .def("model", &PyState::model);
  m.def("train", &train_from_python, py::arg("arguments"));
  m.def("settings", &settings);
}

}  // namespace gflow::python
