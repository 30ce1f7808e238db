// SPDX-License-Identifier: Apache-2.0
// `gflow eval`: evaluates a run again, finished or not, on any split.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "apps/common/report.hpp"
#include "optim/runs/evaluate_run.hpp"
#include "runtime/base/output.hpp"

namespace gflow {

void print_report(const Evaluation& evaluation) {
  if (evaluation.views.empty()) return;
  const ViewMetrics& m = evaluation.mean;
  const auto line = [](const char* name, double value, const char* unit) {
    if (std::isfinite(value)) print_result("{:<22} {:8.3f} {}\n", name, value, unit);
  };
  const auto of_network = [&](const char* name, double value, const std::string& model,
                              const char* setting) {
    if (model.empty())
      print_result("{:<22} no model given ({})\n", name, setting);
    else
      print_result("{:<22} {:8.4f}\n", name, value);
  };
  print_result("{} views{}, flow compared with: {}\n", evaluation.views.size(),
               evaluation.trained_on ? ", all used for training" : "", evaluation.flow_reference);
  line("PSNR", m.psnr, "dB");
  line("PSNR, moving pixels", m.psnr_dynamic, "dB");
  line("SSIM", m.ssim, "");
  line("SSIM, moving pixels", m.ssim_dynamic, "");
  of_network("LPIPS", m.lpips, evaluation.lpips_model, "metrics.lpips");
  of_network("CLIP", m.clip, evaluation.clip_model, "metrics.clip");
  line("flow error", m.flow_epe, "px");
  line("flow error, moving", m.flow_epe_dynamic, "px");
  line("  of the target flow", m.teacher_epe_dynamic, "px");
  line("Fl-all", 100 * m.fl_all, "%");
  line("depth error", 100 * m.depth_error, "%");
  line("flicker", m.flicker, "grey levels");
  if (!evaluation.tracks) return;
  line("3D tracks, error", evaluation.tracks->mean, "scene units");
  if (const auto& seen = evaluation.tracks->seen)
    line("  seen in training", seen->mean, "scene units");
  line("  if nothing moved", evaluation.tracks->still, "scene units");
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
    const RunEvaluation judged =
        evaluate_run(queue, run, flags->split, options.quiet, flags->iteration, flags->settings);
    print_state(judged.state);
    print_report(judged.evaluation);
    if (judged.written.empty()) {
      print_result("metrics   not written: {} is being trained\n", flags->run);
      return;
    }
    print_result("metrics   {}\n", fmt::join(judged.written, ", "));
  });
}

}  // namespace gflow
