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
#include "apps/viewer/server.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/running_program.hpp"

namespace gflow {
namespace {

struct ViewFlags {
  std::vector<std::string> paths;
  ServerOptions server{"127.0.0.1", 8008};
  int iteration = latest_iteration;
  Undrawable undrawable = Undrawable::left_out;
  bool open = false;
};

// Shows the address in the user's browser. The result keeps the program that does so.
std::unique_ptr<RunningProgram> open_browser(const std::string& address) {
  const std::string program = find_on_path("xdg-open");
  if (program.empty()) {
    print_status("no browser opened: there is no xdg-open\n");
    return nullptr;
  }
  return std::make_unique<RunningProgram>(std::vector<std::string>{program, address}, "/dev/null");
}

void run_view(const ViewFlags& flags, const GlobalOptions& options) {
  ViewDevice device([&] { return std::unique_ptr<Queue>(new Queue(open_queue(options))); });
  std::vector<std::unique_ptr<ViewSource>> sources;
  for (const std::string& path : flags.paths)
    sources.push_back(
        std::make_unique<ViewSource>(path, flags.iteration, flags.undrawable, device));
  const InterruptGuard guard;
  const ViewServer server(std::move(sources), flags.server);
  print_result("viewer    {}\n", server.address());
  if (!is_loopback(flags.server.host))
    print_result("Whoever can reach this address can see these models and images\n");
  print_result("Ctrl-C ends it\n");
  std::fflush(stdout);
  std::unique_ptr<RunningProgram> browser;
  if (flags.open) browser = open_browser(server.address());
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
  command->add_option("--port", flags->server.port, "Port to listen on; 0: any free one")
      ->check(number_in(0, 65535))
      ->type_name("N");
  command
      ->add_option("--host", flags->server.host,
                   "Address to listen on. With another than that of this machine alone, such as "
                   "0.0.0.0, whoever can reach it can see the models and their images")
      ->check(path_given())
      ->type_name("HOST");
  command->add_flag("--open", flags->open, "Open the browser");
  add_iteration(*command, flags->iteration);
  add_strict(*command, flags->undrawable);
  command->callback([flags, &options] { run_view(*flags, options); });
}

}  // namespace gflow
