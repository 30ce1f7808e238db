// SPDX-License-Identifier: Apache-2.0
// The gflow command. Every failure becomes one sentence on stderr and an exit code: 0 success, 1 an
// error or a wrong command line, 2 no usable device, 3 `gflow stress` exceeds a bound, 4 the device
// hangs, 128 + signal interrupted.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <sstream>
#include <system_error>

#include "apps/common/command_line.hpp"
#include "apps/common/commit.hpp"
#include "apps/common/help_text.hpp"
#include "apps/common/options.hpp"
#include "apps/common/signals.hpp"
#include "optim/images/decoder_log.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/unfinished_file.hpp"
#include "runtime/cl/pocl_cache.hpp"

namespace {

int report_error(const std::string& sentence, int exit_code) {
  std::fprintf(stderr, "gflow: %s\n", gflow::printable(sentence).c_str());
  return exit_code;
}

// code: errno of the failed write to standard output.
int cannot_print(int code) {
  if (code == EPIPE) return 128 + SIGPIPE;  // the reader exited, as `head` does: no message
  return report_error(fmt::format("cannot write to standard output: {}", std::strerror(code)), 1);
}

bool is_over = false;

// PoCL's LLVM exits the program when it cannot write, with a message that names no file.
void report_exit() {
  if (is_over) return;
  gflow::remove_unfinished_files();
  const std::string why = gflow::compile_failure_reason();
  report_error(
      "a library ended the program; see its message above" + (why.empty() ? "" : "; " + why), 1);
}

// PoCL aborts when a kernel that it could not write is missing. In all other cases the signal keeps
// its default effect.
void report_abort(int) {
  alarm(10);  // corrupt memory may hold a lock
  if (gflow::compile_failure_reason().empty()) {
    gflow::remove_unfinished_files();
    report_error(
        "a library or the OpenCL driver aborted the program; see its message above, if any; files "
        "saved earlier are intact",
        1);
    std::signal(SIGABRT, SIG_DFL);
    std::raise(SIGABRT);
    return;  // the signal is blocked inside its handler and is delivered after it
  }
  report_exit();
  std::_Exit(1);
}

// The options of every sub-command, repeated at the end of each sub-command's --help.
std::string global_help(const CLI::App& app) {
  const gflow::WrappedHelp formatter{};
  std::string text = "Options of every command:\n";
  for (const char* name : {"--device", "--quiet"})
    text += formatter.make_option(app.get_option(name), false);
  return text;
}

void add_commands(CLI::App& app, gflow::GlobalOptions& options) {
  app.formatter(std::make_shared<gflow::WrappedHelp>());  // inherited by the commands
  app.set_version_flag(
      "--version",
      fmt::format("gflow {} (commit {})\nOpenCL: 1.2 and later\nOpenCV: {}\nFFmpeg "
                  "(libavformat): {}\nnetworks (OpenCV dnn): {}",
                  GFLOW_VERSION, gflow::kCommit, GFLOW_OPENCV, GFLOW_LIBAV, GFLOW_NETWORKS));
  app.option_defaults()->always_capture_default();
  app.add_option("--device", options.device,
                 "OpenCL device: its index in `gflow devices` or part of its name")
      ->type_name("INDEX|NAME");
  app.add_flag("--quiet", options.quiet, "No progress on stderr");
  app.require_subcommand(1);
  app.fallthrough();
#ifdef GFLOW_WITH_OPENCV
  gflow::add_train(app, options);
  gflow::add_cameras(app, options);
  gflow::add_render(app, options);
  gflow::add_view(app, options);
  gflow::add_eval(app, options);
  gflow::add_export(app, options);
  gflow::add_info(app, options);
  gflow::add_experiment(app, options);
  gflow::add_settings(app, options);
#endif
  gflow::add_import(app, options);
  gflow::add_splat(app, options);
  gflow::add_bench(app, options);
  gflow::add_stress(app, options);
  gflow::add_devices(app, options);
  gflow::add_completion(app, options);
  for (CLI::App* command : app.get_subcommands({})) command->footer(global_help(app));
}

// Returns the exit code if nothing throws.
int run(int argc, char** argv) {
  CLI::App app("gflow trains moving 3D Gaussian scenes from video on any OpenCL device.", "gflow");
  gflow::GlobalOptions options;
  try {
    add_commands(app, options);
    app.parse(argc, argv);
  } catch (const CLI::RuntimeError& end) {
    return end.get_exit_code();  // a command that has printed its own message
  } catch (const CLI::ParseError& problem) {
    if (problem.get_exit_code() != 0) return report_error(gflow::sentence_for(app, problem), 1);
    std::ostringstream text;  // std::cout would not report a failed write
    app.exit(problem, text, text);
    fmt::print("{}", text.str());  // --help and --version
  }
  return 0;
}

// Returns the exit code in every case.
int run_in_words(int argc, char** argv) {
  try {
    const int code = run(argc, argv);
    return std::fflush(stdout) == 0 ? code : cannot_print(errno);
  } catch (const gflow::Interrupted& stop) {
    return report_error(stop.what(), gflow::interrupted_exit_code());
  } catch (const gflow::NoUsableDevice& problem) {
    return report_error(problem.what(), 2);
  } catch (const gflow::Error& problem) {
    return report_error(problem.what(), 1);
  } catch (const std::bad_alloc&) {
    return report_error(
        "out of memory; to use less, raise scene.resolution, lower density.cap, or give the motion "
        "model fewer keys or smaller planes",
        1);
  } catch (const std::filesystem::filesystem_error& problem) {
    const std::string path = problem.path1().string();
    return report_error(path.empty()
                            ? problem.what()
                            : fmt::format("cannot use {}: {}", path, problem.code().message()),
                        1);
  } catch (const std::system_error& problem) {  // fmt::print to a full disk; no thread available
    if (std::ferror(stdout)) return cannot_print(problem.code().value());
    if (problem.code() == std::errc::resource_unavailable_try_again)
      return report_error(
          fmt::format("cannot start a thread ({}): the limit on threads (ulimit -u, or that "
                      "of the container) is too low",
                      problem.what()),
          1);
    return report_error(problem.what(), 1);
  } catch (const std::exception& problem) {
    return report_error(fmt::format("internal error: {}", problem.what()), 1);
  }
}

}  // namespace

int main(int argc, char** argv) {
  gflow::open_standard_streams();
  gflow::set_signals();
  std::at_quick_exit([] { gflow::remove_unfinished_files(); });  // a device hangs: Watchdog
  std::atexit(report_exit);
  std::signal(SIGABRT, report_abort);
#ifdef GFLOW_WITH_OPENCV
  gflow::silence_opencv();
#endif
  const int code = run_in_words(argc, argv);
  is_over = true;
  return code;
}
