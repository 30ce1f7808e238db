// SPDX-License-Identifier: Apache-2.0
// `gflow experiment`: runs the trainings that a file names and tabulates their results.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/signals.hpp"
#include "apps/common/version.hpp"
#include "apps/experiments/runs.hpp"
#include "apps/experiments/table.hpp"
#include "apps/report/experiment_report.hpp"
#include "optim/train/guidance_provider.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/cl/device.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/file_lock.hpp"
#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

using namespace experiments;

struct ExperimentFlags {
  std::string file, folder, scenes = ".";
  std::vector<std::string> devices;
  int jobs = 0;
  bool dry_run = false, redo = false, allow_command = false;
};

std::string folder_of(const ExperimentFlags& flags) {
  if (!flags.folder.empty()) return flags.folder;
  const std::filesystem::path folder = std::filesystem::path(flags.file).stem();
  std::error_code none;
  if (std::filesystem::equivalent(folder, flags.file, none))
    throw Error(
        fmt::format("{}: the default output folder, the file's name without extension, is the file "
                    "itself; give a folder with -o",
                    flags.file));
  return folder.string();
}

// Lists the planned runs and estimates how long they take.
void print_runs(const Plan& plan, const std::string& folder, int jobs) {
  std::vector<Standing> standings;
  size_t width = 0;
  for (const PlannedRun& run : plan.runs) {
    standings.push_back(standing_of(run, folder));
    width = std::max(width, run.id.size());
  }
  const auto [left, guessed] = time_left(plan, standings);
  const char* about = guessed ? "perhaps" : "about";
  double all = 0, longest = 0;
  for (size_t i = 0; i < plan.runs.size(); ++i) {
    const Standing& s = standings[i];
    std::string state = "not started";
    if (s.status == Status::finished)
      state = fmt::format("finished in {}", duration_text(s.seconds));
    if (s.status == Status::stopped) state = fmt::format("stopped after {} steps", s.steps);
    if (s.status == Status::other_settings) state = "settings changed: " + s.difference;
    if (s.status != Status::finished)
      state += std::isnan(left[i]) ? ", time left unknown"
                                   : fmt::format(", {} {} left", about, duration_text(left[i]));
    print_result("{:<{}}  {:>7} steps  {}\n", plan.runs[i].id, width,
                 plan.runs[i].config.train.iterations, state);
    all += left[i];
    longest = std::max(longest, left[i]);
  }
  const auto finished = std::count_if(standings.begin(), standings.end(), [](const Standing& s) {
    return s.status == Status::finished;
  });
  print_result(
      "{} runs, {} of them finished; {}\n", plan.runs.size(), finished,
      std::isnan(all)
          ? "the time left is unknown until a run has made steps"
          : fmt::format("{} {} left{}{}", about, duration_text(std::max(all / jobs, longest)),
                        jobs > 1 ? fmt::format(" with {} at a time", jobs) : "",
                        guessed ? ", guessed from step count and image size, without evaluation: "
                                  "no run has started"
                                : ""));
}

void write_text(const std::string& path, const std::string& text) {
  write_file_atomically(path, std::string_view(text));
}

void write_everything(const Plan& plan, const std::string& folder) {
  const Results table(plan, results_of(plan, folder));
  write_text(folder + "/table.md", table.markdown());
  write_text(folder + "/table.csv", table.csv());
  write_text(folder + "/table.json", json_text(table.json(), 1) + "\n");
  write_text(folder + "/costs.md", table.costs());
  write_text(folder + "/runs.csv", table.runs_csv());
  print_result("{}\n{}", table.markdown(), table.costs());
  std::string plots;
  for (const std::vector<Plot>& some : {table.bars(), table.curves(folder)})
    for (const Plot& plot : some) plots = draw(plot, folder + "/plots");
  print_result("\ntables    {0}/table.md, .csv, .json, {0}/costs.md, {0}/runs.csv\n", folder);
  if (!plots.empty())
    print_result("plots     {}\n", plots.compare(0, 3, "run") == 0 ? plots : folder + "/plots");
  const std::vector<std::string> sheets = write_contact_sheets(plan, folder);
  for (const std::string& sheet : sheets) print_result("images    {}\n", sheet);
  const std::string report =
      report::write_experiment_report(plan, table, folder, sheets, version_text());
  if (!report.empty()) print_result("report    {}\n", report);
}

// NoUsableDevice where a device that a training needs is missing or unusable. Checked once here:
// otherwise each training would report it, above empty tables.
void require_devices(const Plan& plan, const std::string& folder, const RunOptions& how) {
  std::set<std::string> wanted(how.devices.begin(), how.devices.end());
  if (wanted.empty())
    for (const PlannedRun& run : plan.runs)
      if (standing_of(run, folder).status != Status::finished)
        wanted.insert(run.config.train.device);
  try {
    for (const std::string& device : wanted) {
      const DeviceInfo info = device_info(find_device(device));
      require_usable(info, info.lanes);
    }
  } catch (const Error& problem) {
    throw NoUsableDevice(problem.what());
  }
}

void run_experiment(const ExperimentFlags& flags, const GlobalOptions& options) {
  const Plan plan = read_plan(flags.file, flags.scenes);
  const std::string folder = folder_of(flags);
  require_no_other_tables(folder);
  RunOptions how;
  how.devices = flags.devices;
  if (how.devices.empty() && !options.device.empty()) how.devices = {options.device};
  how.jobs = flags.jobs > 0 ? flags.jobs : std::max<int>(1, int(how.devices.size()));
  how.quiet = options.quiet;
  how.redo = flags.redo;
  require_films(plan);
  how.allow_command = flags.allow_command;
  if (!flags.dry_run || !how.devices.empty()) require_devices(plan, folder, how);
  if (flags.dry_run) return print_runs(plan, folder, how.jobs);
  for (const PlannedRun& run : plan.runs)
    if (!flags.allow_command && standing_of(run, folder).status != Status::finished)
      require_no_program(run.config, fmt::format("{}: training {}", flags.file, run.id));
  std::filesystem::create_directories(folder);
  const FileLock lock(folder + "/.lock", folder);
  let_children_end_with_this();
  try {
    train_all(plan, folder, how);
  } catch (const RunsFailed&) {
    write_everything(plan, folder);  // with the results of the finished runs
    throw;
  }
  write_everything(plan, folder);
}

}  // namespace

void add_experiment(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<ExperimentFlags>();
  CLI::App* command = app.add_subcommand(
      "experiment", "Run the trainings of a file; writes tables, plots and images");
  command->add_option("FILE", flags->file, "Experiment: scenes, settings, choices, seeds")
      ->check(path_given())
      ->required()
      ->type_name("FILE.toml");
  command
      ->add_option("-o,--output", flags->folder,
                   "Folder of runs and tables; default: the file's name, in the current folder")
      ->check(path_given())
      ->type_name("FOLDER")
      ->default_str("");
  command->add_option("--scenes", flags->scenes, "Folder of scenes that are not beside the file")
      ->type_name("FOLDER");
  command->add_option("--jobs", flags->jobs, "Trainings at a time; 0: one per device")
      ->check(number_in(0, 256));
  command
      ->add_option("--devices", flags->devices,
                   "Devices for the trainings, in turn, as for --device, separated by commas")
      ->delimiter(',')
      ->check(list_entry())
      ->type_name("INDEX|NAME,...")
      ->default_str("");
  command->add_flag("--dry-run", flags->dry_run, "Print what would be trained, without training");
  command->add_flag("--redo", flags->redo, "Retrain runs whose settings differ from the file");
  command->add_flag("--allow-command", flags->allow_command,
                    "Start the programs given by guidance.command in the file");
  command->callback([flags, &options] { run_experiment(*flags, options); });
}

}  // namespace gflow
