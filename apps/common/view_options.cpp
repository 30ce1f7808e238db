// SPDX-License-Identifier: Apache-2.0
#include "apps/common/view_options.hpp"

#include <cstdio>

#include "apps/common/options.hpp"
#include "runtime/base/output.hpp"

namespace gflow {
namespace {

// Shows the address in the user's browser. The result keeps the program that does so.
std::unique_ptr<RunningProgram> open_browser(const std::string& address) {
  const std::string program = find_on_path("xdg-open");
  if (program.empty()) {
    print_status("no browser opened: there is no xdg-open\n");
    return nullptr;
  }
  return std::make_unique<RunningProgram>(std::vector<std::string>{program, address}, "/dev/null");
}

}  // namespace

void add_server_options(CLI::App& command, ServerOptions& server, bool& open,
                        const std::string& of) {
  command.add_option("--port", server.port, "Port" + of + "; 0: any free one")
      ->check(number_in(0, 65535))
      ->type_name("N");
  command
      .add_option("--host", server.host,
                  "Address" + of +
                      " to listen on. With another than that of this machine alone, "
                      "such as 0.0.0.0, whoever can reach it can see the models and their images")
      ->check(path_given())
      ->type_name("HOST");
  command.add_flag("--open", open, "Open the browser" + (of.empty() ? "" : " at the page" + of));
}

std::unique_ptr<RunningProgram> announce(const ViewServer& server, const ServerOptions& options,
                                         bool open) {
  print_result("viewer    {}\n", server.address());
  if (!is_loopback(options.host))
    print_result("Whoever can reach this address can see these models and images\n");
  std::fflush(stdout);
  return open ? open_browser(server.address()) : nullptr;
}

}  // namespace gflow
