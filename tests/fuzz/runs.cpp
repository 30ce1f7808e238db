// SPDX-License-Identifier: Apache-2.0
// Files and input of gflow itself: settings, experiments, models, checkpoints, run folders,
// reports, compiled kernels; messages of guidance programs, networks, arrays of `gflow splat`.
#include "apps/experiments/runs.hpp"

#include <cmath>
#include <stdexcept>

#include "apps/bench/measure/old_report.hpp"
#include "apps/experiments/plan.hpp"
#include "apps/experiments/table.hpp"
#include "apps/stress/training/request.hpp"
#include "optim/engine/splat_file.hpp"
#include "optim/guidance/process.hpp"
#include "optim/networks/onnx_inputs.hpp"
#include "optim/options/train_options.hpp"
#include "optim/runs/checkpoint.hpp"
#include "optim/runs/run_folder.hpp"
#include "runtime/base/hash.hpp"
#include "runtime/cl/program_cache.hpp"
#include "tests/fuzz/inputs.hpp"
#include "tests/support/device.hpp"
#include "tests/support/random_model.hpp"

namespace gflow::fuzz {
namespace {

void config(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "config.toml", [](const std::string& path) {
    TrainOptions config;
    apply_file(config, path);
    check(config);
  });
}
void config_seeds(const std::string& to) { seed(to, "a", to_toml(TrainOptions())); }

// A model of each motion model and its second file; the first byte selects.
constexpr size_t kMotions = 5;
const Files& model_files(size_t motion) {
  static const std::vector<Files> all = [] {
    std::vector<Files> files;
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
  const Files& files = model_files(bytes[0] / 2);
  fs::remove(folder() + "/model/m.motion.npz");
  in_scene(bytes, size, "model", files,
           [](const std::string& path) { read_model(path + "/m.ply"); });
}
Holds held_by_model(const uint8_t* bytes, size_t size) {
  return size == 0 ? Holds::its_size : held_by(model_files(bytes[0] / 2), bytes, size);
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
  some.facts.config = to_toml(TrainOptions());
  some.arrays["a"] = {{2}, std::vector<float>{1, 2}};
  seed(to, "a", written("s.npz", [&](const std::string& p) { write_checkpoint(p, some); }));
}

// Scene folders that experiments name; their contents are not read.
void make_scenes() {
  for (const char* name : {"ball", "cube"}) fs::create_directories(folder() + "/" + name);
}

// An experiment file with its scenes and settings.
void plan(const uint8_t* bytes, size_t size) {
  make_scenes();
  write("base.toml", "train.iterations = 7\n");
  as_file(bytes, size, "plan.toml", [](const std::string& path) {
    const experiments::Plan plan = experiments::read_plan(path, folder());
    // A few runs only, so that most time is spent in the reader.
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

// A finished run, as read by an experiment and a resumed training.
const experiments::Plan& finished_plan() {
  static const experiments::Plan plan = [] {
    make_scenes();
    write("one.toml", "scenes = ['ball']\n");
    return experiments::read_plan(folder() + "/one.toml", folder());
  }();
  return plan;
}
const Files& run_files() {
  static const Files files{
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
    run.metrics_options();
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

// Output of a guidance program: its greeting and an answer.
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

// A previous report, as read by `gflow bench --compare`.
void bench_report(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "report.json", [](const std::string& path) {
    const bench::Json report = bench::read_report(path, "raster");
    bench::text_of(report, "device");
    for (const auto& [name, row] : report["rows"].items())
      bench::value_in(report["rows"], name, "wall [ms]");
  });
}
void bench_report_seeds(const std::string& to) {
  seed(to, "a",
       R"({"bench": "raster", "device": "PoCL", "lanes": 16, "rows": {"bin to gather":
           {"wall [ms]": {"median": 5.5, "low": 5, "high": 6}, "bytes": 90}}, "notes": ["x"]})");
}

void onnx(const uint8_t* bytes, size_t size) {
  as_file(bytes, size, "a.onnx", [](const std::string& path) { onnx_input_list(path); });
}
void onnx_seeds(const std::string& to) {
  for (const char* name : {"guidance/denoiser.onnx", "networks/lpips.onnx"})
    copy_seed(to, fmt::format("{}/tests/data/{}", GFLOW_SOURCE_DIR, name));
}

// A file of the cache of compiled kernels. The driver receives what passes the checks.
constexpr uint64_t kKey = 7;
void program_cache(const uint8_t* bytes, size_t size) {
  const std::string_view file(reinterpret_cast<const char*>(bytes), size);
  const std::string_view binary = verified_binary(file, kKey);
  if (binary.size() > size) throw std::logic_error("more than the file has");
}
void program_cache_seeds(const std::string& to) {
  const std::string binary = "compiled";
  const uint64_t header[2] = {binary.size(), hash(binary, kKey)};
  const std::string file =
      "GFLOWBI2" + std::string(reinterpret_cast<const char*>(header), sizeof header) + binary;
  if (verified_binary(file, kKey) != binary) throw std::logic_error("the seed is not sound");
  seed(to, "a", file);
}

// Arrays of `gflow splat`, uploaded to a device.
const std::string& splat_file() {
  static const std::string file = written("s.npz", [](const std::string& path) {
    const auto array = [](std::vector<size_t> shape, std::vector<float> values) {
      return Array{std::move(shape), std::move(values)};
    };
    const std::vector<float> pose{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1};
    write_npz(path,
              {{"means", array({1, 3}, {0, 0, 0})},
               {"quats", array({1, 4}, {1, 0, 0, 0})},
               {"scales", array({1, 3}, {1, 1, 1})},
               {"opacities", array({1}, {.5f})},
               {"colors", array({1, 3}, {1, 0, 1})},
               {"viewmat", array({4, 4}, pose)},
               {"K", array({3, 3}, {8, 0, 4, 0, 8, 3, 0, 0, 1})},
               {"size", {{2}, std::vector<int32_t>{8, 6}}},
               {"means_t2", array({1, 3}, {1, 0, 0})},
               {"quats_t2", array({1, 4}, {1, 0, 0, 0})},
               {"scales_t2", array({1, 3}, {1, 1, 1})}},
              Packing::stored);
  });
  return file;
}
void splat(const uint8_t* bytes, size_t size) {
  const auto read = [](Queue& queue, const std::string& path) {
    splat_scene(queue, read_npz(path, splat_arrays_known), .01f, path);
  };
  static Queue queue = [&] {  // compiles its kernels before memory is counted
    Queue opened = test_queue();
    write("first.npz", splat_file());
    read(opened, folder() + "/first.npz");
    return opened;
  }();
  as_zip(bytes, size, "splat.npz", [&](const std::string& path) { read(queue, path); });
}
void splat_seeds(const std::string& to) { seed(to, "a", splat_file()); }

}  // namespace

std::vector<Target> run_targets() {
  return {{"config", config, config_seeds, its_size},
          {"model", model, model_seeds, held_by_model},
          {"checkpoint", checkpoint, checkpoint_seeds, packed_file},
          {"plan", plan, plan_seeds, its_size},
          {"run_folder", run_folder, run_folder_seeds, held<run_files>},
          {"bench_report", bench_report, bench_report_seeds, its_size},
          {"program_cache", program_cache, program_cache_seeds, its_size},
          {"onnx", onnx, onnx_seeds, its_size},
          {"splat", splat, splat_seeds, packed_file},
          {"guidance", guidance, guidance_seeds, its_size}};
}

}  // namespace gflow::fuzz
