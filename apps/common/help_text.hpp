// SPDX-License-Identifier: Apache-2.0
// Help in two columns, wrapped to the width of the terminal.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

namespace gflow {

// "  name  text" and a line end, where the text begins at `column`, on the next line after a long
// name, and is wrapped below itself.
std::string two_columns(const std::string& name, const std::string& text, size_t column);

// CLI11's help with all descriptions wrapped.
class WrappedHelp : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_description(const CLI::App* app) const override;
};

}  // namespace gflow
