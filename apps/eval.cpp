// SPDX-License-Identifier: Apache-2.0
// `gflow eval`: evaluates a run again, finished or not, on any split.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "apps/common/report.hpp"
#include "apps/common/version.hpp"
#include "apps/report/recorded_notices.hpp"
#include "apps/report/write_run_report.hpp"
#include "optim/runs/evaluate_run.hpp"
#include "runtime/base/output.hpp"

namespace gflow {

void print_report(const Evaluation& evaluation, const RunFacts& facts) {
  if (evaluation.views.empty()) return;
  const auto row = [](const char* name, double value, int digits, const char* unit) {
    if (std::isfinite(value)) print_result("  {:<28} {:>10.{}f}{}\n", name, value, digits, unit);
  };
  const ViewMetrics& m = evaluation.mean;
  print_result("{} views{}{}:\n", evaluation.views.size(),
               evaluation.trained_on ? ", all used for training" : "",
               evaluation.flow_reference == "true"  ? ", flow compared with the true flow"
               : evaluation.flow_reference == "dis" ? ", flow compared with that of DIS"
                                                    : "");
  row("PSNR", m.psnr, 2, " dB");
  row("  before cameras were fitted", m.psnr_unfitted, 2, " dB");
  row("PSNR with matched colours", m.psnr_matched, 2, " dB");
  row("PSNR of moving pixels", m.psnr_dynamic, 2, " dB");
  row("SSIM", m.ssim, 4, "");
  row("SSIM of moving pixels", m.ssim_dynamic, 4, "");
  row("LPIPS", m.lpips, 4, "");
  row("CLIP", m.clip, 4, "");
  row("flow error", m.flow_epe, 3, " px");
  row("flow error of moving pixels", m.flow_epe_dynamic, 3, " px");
  row("  of DIS at these pixels", m.teacher_epe_dynamic, 3, " px");
  row("Fl-all", 100 * m.fl_all, 2, " %");
  row("depth error", 100 * m.depth_error, 2, " %");
  row("flicker", m.flicker, 3, " grey levels");
  if (const auto& tracks = evaluation.tracks) {
    row("3D track error", tracks->mean, 4, " scene units");
    if (tracks->seen) row("  of points seen in training", tracks->seen->mean, 4, " scene units");
    if (tracks->from_view)
      row("  median from what is shown", *tracks->from_view, 4, " scene units");
    row("  of a model without motion", tracks->still, 4, " scene units");
  }
  row("Gaussians", double(evaluation.gaussians), 0, "");
  if (facts.train_seconds > 0) row("training time", facts.train_seconds, 0, " s");
  if (facts.peak_memory_mib > 0) row("peak memory", facts.peak_memory_mib, 0, " MiB");
  if (evaluation.lpips_model.empty())
    print_result("LPIPS needs a network: --set metrics.lpips=FILE.onnx\n");
}

void add_eval(CLI::App& app, const GlobalOptions& options) {
  struct Flags {
    std::string run, split = "test";
    std::vector<std::string> settings;
    int iteration = latest_iteration;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* command = app.add_subcommand(
      "eval", "Evaluate a run, finished or not, and write results.json and per_view.json");
  command->add_option("RUN", flags->run, "Run folder of `gflow train`")
      ->check(path_given())
      ->required()
      ->type_name("FOLDER");
  command->add_option("--split", flags->split, "Views: test, train or val")
      ->check(choice_of({"test", "train", "val"}));
  add_iteration(*command, flags->iteration);
  command
      ->add_option("--set", flags->settings,
                   "Network for evaluation, e.g. --set metrics.lpips=alex.onnx or "
                   "metrics.clip=...; may be repeated. No other setting can be changed here")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->callback([flags, &options] {
    const RunFolder run = RunFolder::open(flags->run);
    Queue queue = open_queue(options);
    const RunEvaluation evaluated =
        evaluate_run(queue, run, flags->split, options.quiet, flags->iteration, flags->settings);
    print_state(evaluated.state);
    print_report(evaluated.evaluation, evaluated.facts);
    if (evaluated.written.empty()) {
      print_result("metrics   not written: {} is being trained\n", flags->run);
      return;
    }
    print_result("metrics   {}\n", fmt::join(evaluated.written, ", "));
    // The report is of the latest model's test views, or of training views if there are no others.
    const bool is_latest = flags->iteration == latest_iteration;
    const bool tested = std::filesystem::exists(run.path("results.json"));
    if (!is_latest || flags->split != (tested ? "test" : "train")) return;
    const std::string report = report::write_run_report(
        queue, run, evaluated.evaluation, flags->split, version_text(), report::read_notices(run));
    if (!report.empty()) print_result("report    {}\n", report);
  });
}

}  // namespace gflow
