// SPDX-License-Identifier: Apache-2.0
#include "apps/common/help_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/base/terminal.hpp"
#include "runtime/base/wrapped.hpp"

namespace gflow {

std::string two_columns(const std::string& name, const std::string& text, size_t column) {
  const std::string head = "  " + name, indent(column, ' ');
  // help2man needs two spaces between the columns.
  const bool fits = head.size() + 2 <= column;
  const std::string gap = fits ? std::string(column - head.size(), ' ') : "\n" + indent;
  return fmt::format("{}{}{}\n", head, gap,
                     fmt::join(wrapped(text, line_width() - column), "\n" + indent));
}

std::string WrappedHelp::make_option(const CLI::Option* option, bool is_positional) const {
  return two_columns(make_option_name(option, is_positional) + make_option_opts(option),
                     make_option_desc(option), get_column_width());
}

std::string WrappedHelp::make_subcommand(const CLI::App* command) const {
  return two_columns(command->get_display_name(true), command->get_description(),
                     get_column_width());
}

std::string WrappedHelp::make_description(const CLI::App* app) const {
  return fmt::format("{}\n", fmt::join(wrapped(app->get_description(), line_width()), "\n"));
}

}  // namespace gflow
