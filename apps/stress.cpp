// SPDX-License-Identifier: Apache-2.0
// `gflow stress`: numerical stress tests on the user's device.
#include "apps/stress/stress.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/base/wrapped.hpp"
#include "runtime/cl/pocl_cache.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {
namespace {

using namespace stress;

struct StressFlags {
  bool quick = false, derivatives = false;
  std::vector<std::string> only;
  std::string json;
};

// "T7" for "T7", " t7" or "07". Throws an Error if it is not a number.
std::string test_number(const std::string& word) {
  size_t at = std::min(word.find_first_not_of(" \t"), word.size());
  if (at < word.size() && (word[at] == 'T' || word[at] == 't')) ++at;
  const std::string digits = word.substr(at);
  if (digits.empty() || digits.find_first_not_of("0123456789") != digits.npos)
    throw Error(fmt::format("--only: '{}' is not a number of a test; use e.g. T7 or T7,T12",
                            excerpt(word, 40)));
  return "T" + digits.substr(std::min(digits.find_first_not_of('0'), digits.size() - 1));
}

// The selected tests. Throws an Error that lists the valid numbers if one is unknown.
Tests chosen(const StressFlags& flags) {
  Tests all = all_tests(), wanted;
  std::vector<std::string> left_out;  // tests of --only that --quick leaves out
  std::vector<std::string> only = flags.only;
  for (std::string& id : only) {
    id = test_number(id);
    const bool known =
        std::any_of(all.begin(), all.end(), [&](const Test& t) { return t.id == id; });
    if (known) continue;
    std::string ids;
    for (const Test& t : all)  // a number may have two tests
      if (ids.find(t.id + ", ") == std::string::npos) ids += t.id + ", ";
    throw Error(fmt::format(
        "--only {}: no such test; there are {}. T42 to T45 and T47 have their own "
        "commands: tests/faults/run, tests/fuzz/run, tests/second_opinions, gflow bench pareto",
        id, ids.substr(0, ids.size() - 2)));
  }
  for (Test& t : all) {
    const bool named = std::find(only.begin(), only.end(), t.id) != only.end();
    if (named && flags.quick && !t.quick) left_out.push_back(fmt::format("{} '{}'", t.id, t.name));
    if ((only.empty() || named) && (t.quick || !flags.quick)) wanted.push_back(std::move(t));
  }
  if (wanted.empty())
    throw Error("--quick skips every test that --only names; omit --quick to run them");
  if (!left_out.empty())
    warn(fmt::format("--quick skips {}, which --only names", fmt::join(left_out, ", ")));
  return wanted;
}

const char* verdict(bool good) { return good ? "ok" : "FAILS"; }

struct Outcome {
  size_t passed = 0, failed = 0;
  std::vector<std::string> failures;  // table lines of the failed tests
  nlohmann::ordered_json tests = nlohmann::ordered_json::array();
  nlohmann::ordered_json derivatives = nlohmann::ordered_json::array();
};

// Width of a condition: what value, bound and verdict leave of a line of 80 characters.
constexpr size_t kLine = 80, kCondition = 49;

std::string heading_of(const Test& test) {
  return fmt::format("{:<4}{:<{}} {:>9} {:>9}\n", test.id, test.name, kCondition, "value", "bound");
}

std::string text_of(const stress::Row& row) {
  std::vector<std::string> lines = wrapped(row.condition, kCondition, "  ");
  lines.back() = fmt::format("{:<{}} {:>9.3g} {:>9.2g}  {}", lines.back(), kCondition, row.value,
                             row.bound, verdict(passed(row)));
  return fmt::format("    {}\n", fmt::join(lines, "\n    "));
}

std::string text_of(const Derivative& d) {
  return fmt::format(
      "{}\n    to double {:.2g}, bound {:.2g}; differences {:.2g}, bound {:.2g}  {}\n",
      fmt::join(wrapped(fmt::format("{} by {}", d.kernel, d.parameters), kLine, "  "), "\n"),
      d.against_double, d.double_bound, d.against_differences, d.differences_bound,
      verdict(passed(d)));
}

void run_test(Queue& queue, const Test& test, bool quiet, Outcome& outcome) {
  if (!quiet) print_status("{} {} ...\n", test.id, test.name);
  const auto start = std::chrono::steady_clock::now();
  Rows rows;
  try {
    rows = test.run(queue);
  } catch (const NoRoomForPrograms&) {
    throw;  // not the device's fault
  } catch (const NoTemporaryFolder&) {
    throw;
  } catch (const Error& problem) {
    rows = {{problem.what(), std::nan(""), 0}};
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  nlohmann::ordered_json values = nlohmann::ordered_json::array();
  fmt::print("{}", heading_of(test));
  for (const stress::Row& row : rows) {
    const bool good = passed(row);
    ++(good ? outcome.passed : outcome.failed);
    fmt::print("{}", text_of(row));
    if (!good) outcome.failures.push_back(heading_of(test) + text_of(row));
    values.push_back({{"condition", row.condition},
                      {"figure", row.value},
                      {"bound", row.bound},
                      {"passed", good}});
  }
  std::fflush(stdout);
  outcome.tests.push_back(
      {{"test", test.id}, {"name", test.name}, {"seconds", seconds}, {"values", values}});
}

void run_derivatives(Queue& queue, Outcome& outcome) {
  fmt::print("\nderivatives: device vs double, and double vs differences\n");
  for (const Derivative& d : stress::derivatives(queue)) {
    const bool good = passed(d);
    ++(good ? outcome.passed : outcome.failed);
    fmt::print("{}", text_of(d));
    if (!good) outcome.failures.push_back(text_of(d));
    outcome.derivatives.push_back({{"kernel", d.kernel},
                                   {"parameters", d.parameters},
                                   {"against_double", d.against_double},
                                   {"double_bound", d.double_bound},
                                   {"against_differences", d.against_differences},
                                   {"differences_bound", d.differences_bound},
                                   {"passed", good}});
  }
}

void run(const StressFlags& flags, const GlobalOptions& options) {
  const Tests tests = chosen(flags);
  require_writable("--json", flags.json);
  Queue queue = open_queue(options);
  const InterruptGuard guard;
  Outcome outcome;
  fmt::print("{}, {} lanes\n", queue.info.full_name(), queue.lanes);
  if (!flags.derivatives)
    for (const Test& test : tests)
      if (!interrupted()) run_test(queue, test, options.quiet, outcome);
  if (flags.only.empty() && !interrupted()) run_derivatives(queue, outcome);
  const size_t left_out = flags.derivatives ? 0 : tests.size() - outcome.tests.size();
  const bool table_left_out = flags.only.empty() && outcome.derivatives.empty();
  const bool stopped = left_out > 0 || table_left_out;
  if (!outcome.failures.empty()) fmt::print("\nfailed:\n{}", fmt::join(outcome.failures, ""));
  fmt::print("\n{} of {} values within their bounds\n", outcome.passed,
             outcome.passed + outcome.failed);
  if (!flags.json.empty()) {
    const nlohmann::ordered_json all{{"device", queue.info.full_name()},
                                     {"driver", queue.info.driver},
                                     {"lanes", queue.lanes},
                                     {"interrupted", stopped},
                                     {"passed", outcome.passed},
                                     {"failed", outcome.failed},
                                     {"tests", outcome.tests},
                                     {"derivatives", outcome.derivatives}};
    const std::string text = all.dump(1) + "\n";
    write_file_atomically(flags.json, Bytes(text.begin(), text.end()));
  }
  if (stopped)
    throw Interrupted(
        fmt::format("interrupted: {} of {} tests and {}table of derivatives were "
                    "skipped; the values above are complete{}",
                    left_out, tests.size(), table_left_out ? "the " : "no ",
                    flags.json.empty() ? "" : ", and in " + flags.json));
  if (interrupted())
    throw Interrupted("interrupted; the last test had begun and is included above");
  if (outcome.failed > 0) throw CLI::RuntimeError(3);
}

}  // namespace

void add_stress(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<StressFlags>();
  CLI::App* command = app.add_subcommand(
      "stress", "Test the numerics on this device; exit code 3 if a bound is exceeded");
  auto* all = command->add_flag("--all", "All tests (default)");
  command->add_flag("--quick", flags->quick, "Skip the longest tests; about a minute")
      ->excludes(all);
  auto* only =
      command->add_option("--only", flags->only, "Only tests with these numbers, e.g. T7,T12")
          ->delimiter(',')
          ->check(list_entry())
          ->type_name("NUMBERS");
  command->add_flag("--derivatives", flags->derivatives, "Only the table of derivatives")
      ->excludes(only);
  command->add_option("--json", flags->json, "Write the results to this file")
      ->check(path_given())
      ->type_name("FILE");
  command->callback([flags, &options] { run(*flags, options); });
}

}  // namespace gflow
