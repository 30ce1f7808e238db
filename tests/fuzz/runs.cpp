// SPDX-License-Identifier: Apache-2.0
// What gflow itself writes and is told: settings, experiments, models, checkpoints, a run's folder,
// a guidance program's words.
#include "apps/experiments/runs.hpp"

#include <cmath>
#include <stdexcept>

#include "apps/experiments/plan.hpp"
#include "apps/experiments/table.hpp"
#include "fuzz/inputs.hpp"
#include "guidance/request.hpp"
#include "optim/guidance/process.hpp"
#include "optim/train/checkpoint.hpp"
#include "optim/train/config.hpp"
#include "optim/train/run_folder.hpp"
#include "train/random_model.hpp"

namespace gflow::fuzz {
namespace {

void config(const uint8_t* bytes, size_t size) {
  may_refuse([&] {
    TrainConfig config;
    apply_text(config, std::string(bytes, bytes + size), "the input");
    check(config);
  });
}
void config_seeds(const std::string& to) { seed(to, "a", to_toml(TrainConfig())); }

// A model of each motion, and what it keeps in a second file: the first byte chooses.
constexpr size_t kMotions = 5;
const std::vector<File>& model_files(size_t motion) {
  static const std::vector<std::vector<File>> all = [] {
    std::vector<std::vector<File>> files;
    for (size_t k = 0; k < kMotions; ++k) {
      const std::string path = folder() + "/made.ply";
      fs::remove(tables_path(path));
      write_model(path, random_model(2, 1, MotionModelKind(k)));
      files.push_back({{"m.ply", contents(path)}});
      if (fs::exists(tables_path(path)))
        files.back().push_back({"m.motion.npz", contents(tables_path(path))});
    }
    return files;
  }();
  return all[motion % kMotions];
}
void model(const uint8_t* bytes, size_t size) {
  if (size == 0) return;
  const std::vector<File>& files = model_files(bytes[0] / 2);
  fs::remove(folder() + "/model/m.motion.npz");
  in_scene(bytes, size, "model", files,
           [](const std::string& path) { read_model(path + "/m.ply"); });
}
void model_seeds(const std::string& to) {
  for (size_t k = 0; k < kMotions; ++k)
    for (size_t file = 0; file < model_files(k).size(); ++file)
      seed(to, fmt::format("{}_{}", k, file),
           std::string(1, char(2 * k + file)) + model_files(k)[file].text);
}

void checkpoint(const uint8_t* bytes, size_t size) {
  as_zip(bytes, size, "c.npz", [](const std::string& path) { read_checkpoint(path); });
  may_refuse([] { read_checkpoint_facts(folder() + "/c.npz"); });
}
void checkpoint_seeds(const std::string& to) {
  Checkpoint some;
  some.facts.config = to_toml(TrainConfig());
  some.arrays["a"] = {{2}, std::vector<float>{1, 2}};
  seed(to, "a", written("s.npz", [&](const std::string& p) { write_checkpoint(p, some); }));
}

// Folders of scenes that experiments name; nobody reads what is in them.
void make_scenes() {
  for (const char* name : {"ball", "cube"}) fs::create_directories(folder() + "/" + name);
}

// An experiment file and what its scenes and settings name.
void plan(const uint8_t* bytes, size_t size) {
  make_scenes();
  write("base.toml", "train.iterations = 7\n");
  as_file(bytes, size, "plan.toml", [](const std::string& path) {
    const experiments::Plan plan = experiments::read_plan(path, folder());
    // Of few runs, so that most inputs are of the reader.
    for (size_t i = 0; i < std::min(plan.runs.size(), size_t{4}); ++i)
      experiments::standing_of(plan.runs[i], folder());
  });
}
void plan_seeds(const std::string& to) {
  seed(to, "all", R"(title = "Flow"
scenes = ["ball", { path = "cube", name = "box", flow.weight = 0.5 }]
seeds = [0, 1]
config = "base.toml"
metrics = ["psnr"]
baseline = ["off", "*"]
films = ["cam00@0-3"]
[settings]
train.iterations = 30
[[axis]]
name = "flow"
choices = [{ name = "off", flow.weight = 0 }, { name = "DIS" }]
[[axis]]
setting = "flow.top_k"
values = [0, 20]
)");
  seed(to, "variants", "scenes = ['ball']\n[[variant]]\nname = 'x'\nloss.rigidity = 1\n");
  for (const auto& entry : fs::directory_iterator(GFLOW_SOURCE_DIR "/apps/experiments"))
    if (entry.path().extension() == ".toml") copy_seed(to, entry.path().string());
}

// What a finished run has left, as an experiment and a training that goes on read it.
const experiments::Plan& finished_plan() {
  static const experiments::Plan plan = [] {
    make_scenes();
    write("one.toml", "scenes = ['ball']\n");
    return experiments::read_plan(folder() + "/one.toml", folder());
  }();
  return plan;
}
const std::vector<File>& run_files() {
  static const std::vector<File> files{
      // Without the defaults, which take a tenth of a second to read.
      {"config.toml",
       fmt::format("[scene]\npath = '{}'\n", finished_plan().runs[0].config.scene.path)},
      {"training.json", R"({"iterations": 7, "train_seconds": 1.5, "peak_memory_mib": 90.5,
                            "device": "PoCL", "motion": "spacetime", "finished": true})"},
      {"metrics.jsonl", R"({"iteration": 0, "seconds": 0.1, "loss": 0.3, "psnr": 20.5}
{"iteration": 1, "seconds": 0.2, "loss": 0.2, "psnr": 21.5, "flow_epe": null}
)"},
      {"results.json", R"({"test": {"psnr": 30.5, "flow_epe": 0.5, "by_step": {"psnr": [30, 31]},
                           "tracks": {"mean": 0.1, "seen": {"mean": 0.1}}, "lpips_model": "x"},
                           "num_gaussians": 90, "iterations": 7, "train_seconds": 1.5})"}};
  return files;
}
void run_folder(const uint8_t* bytes, size_t size) {
  const experiments::Plan& plan = finished_plan();
  const std::string at = "experiment/runs/" + plan.runs[0].id;
  write(at + ".toml", run_files()[0].text);
  in_scene(bytes, size, at, run_files(), [&](const std::string& path) {
    const RunFolder run = RunFolder::open(path);
    may_refuse([&] { run.read_config(); });
    may_refuse([&] { run.read_facts(); });
    run.judged_by();
    const std::string experiment = folder() + "/experiment";
    may_refuse([&] { experiments::standing_of(plan.runs[0], experiment); });
    const experiments::Results results(plan, experiments::results_of(plan, experiment));
    for (const std::string& text : {results.markdown(), results.costs(), results.csv()})
      if (text.empty()) throw std::logic_error("a table without a heading");
    results.json();
    results.bars();
    results.curves(experiment);
    run.keep_metrics_before(1);
  });
}
void run_folder_seeds(const std::string& to) { seeds_of(to, run_files()); }

// What a guidance program says: its greeting and an answer.
void guidance(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "words", [](const std::string& path) {
    ProcessGuidance program("cat " + path, 1, {});
    for (const GuidanceAnswer& answer : program.guide(some_request(2, 4, 3, true)))
      if (!std::isfinite(answer.weight + answer.flow_weight))
        throw std::logic_error("a weight that is not finite");
  });
}
void guidance_seeds(const std::string& to) {
  seed(to, "all", R"({"version": 1}
{"views": [{"gradient": [3, 3, 4], "weight": 0.5}, {"flow": [2, 3, 4], "confidence": [3, 4]}]}
)");
  seed(to, "error", "{\"version\": 1}\n{\"error\": \"no network\"}\n");
}

}  // namespace

std::vector<Target> run_targets() {
  return {{"config", config, config_seeds},
          {"model", model, model_seeds, Holds::packed},
          {"checkpoint", checkpoint, checkpoint_seeds, Holds::packed},
          {"plan", plan, plan_seeds},
          {"run_folder", run_folder, run_folder_seeds, Holds::packed},
          {"guidance", guidance, guidance_seeds}};
}

}  // namespace gflow::fuzz
