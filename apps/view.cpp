// SPDX-License-Identifier: Apache-2.0
// `gflow view`: shows runs and splat files in a browser.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <thread>

#include "apps/common/command_line.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "apps/common/view_options.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"

namespace gflow {
namespace {

struct ViewFlags {
  std::vector<std::string> paths;
  ServerOptions server{"127.0.0.1", 8008};
  int iteration = latest_iteration;
  Undrawable undrawable = Undrawable::left_out;
  bool open = false;
};

void run_view(const ViewFlags& flags, const GlobalOptions& options) {
  ViewDevice device([&] { return std::unique_ptr<Queue>(new Queue(open_queue(options))); });
  std::vector<std::unique_ptr<ViewSource>> sources;
  for (const std::string& path : flags.paths)
    sources.push_back(
        std::make_unique<ViewSource>(path, flags.iteration, flags.undrawable, device));
  const InterruptGuard guard;
  const ViewServer server(std::move(sources), flags.server);
  const auto browser = announce(server, flags.server, flags.open);
  print_result("Ctrl-C ends it\n");
  std::fflush(stdout);
  while (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  throw Interrupted("the viewer was stopped");
}

}  // namespace

void add_view(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<ViewFlags>();
  CLI::App* command =
      app.add_subcommand("view", "Show runs, also while they train, and splat files in a browser");
  command->add_option("RUN|FILE", flags->paths, "Run folders of `gflow train`, or any splat files")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  add_server_options(*command, flags->server, flags->open);
  add_iteration(*command, flags->iteration);
  add_strict(*command, flags->undrawable);
  command->callback([flags, &options] { run_view(*flags, options); });
}

}  // namespace gflow
