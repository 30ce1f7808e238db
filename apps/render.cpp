// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include "apps/options.hpp"
namespace gflow {
void add_render(CLI::App&, const GlobalOptions&) {}
}  // namespace gflow
