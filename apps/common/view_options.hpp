// SPDX-License-Identifier: Apache-2.0
// What commands with a viewer share: its options, and its address for the user.
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "apps/viewer/server.hpp"
#include "runtime/base/running_program.hpp"

namespace gflow {

// --port, --host and --open. of: said after the names of what they set.
void add_server_options(CLI::App& command, ServerOptions& server, bool& open,
                        const std::string& of = "");

// Prints the address of a viewer, and who can reach it; open: shows it in the user's browser, whose
// program the result keeps.
std::unique_ptr<RunningProgram> announce(const ViewServer& server, const ServerOptions& options,
                                         bool open);

}  // namespace gflow
