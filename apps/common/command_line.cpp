// SPDX-License-Identifier: Apache-2.0
#include "apps/common/command_line.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/base/decimal.hpp"
#include "runtime/base/edit_distance.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// "a, b or c"
std::string listing(const std::vector<std::string>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 < words.size() ? ", " : " or ") + words[i];
  return text;
}

// ", the nearest is b" if a word is close enough, else empty. The dashes of options do not count.
std::string nearest(const std::string& word, const std::vector<std::string>& words) {
  const auto letters = [](const std::string& name) {
    return name.substr(std::min(name.find_first_not_of('-'), name.size()));
  };
  const std::string wanted = letters(word);
  const auto distance = [&](const std::string& name) {
    return edit_distance(wanted, letters(name));
  };
  const std::string& best = *std::min_element(
      words.begin(), words.end(),
      [&](const std::string& a, const std::string& b) { return distance(a) < distance(b); });
  // About one letter in three: half of them would call --version the nearest of --overwrite.
  return distance(best) <= (wanted.size() + 1) / 3 ? ", the nearest is " + best : "";
}

// The commands parsed so far: gflow, gflow train, gflow bench raster.
std::vector<const CLI::App*> understood(const CLI::App& app) {
  std::vector<const CLI::App*> path{&app};
  while (!path.back()->get_subcommands().empty())
    path.push_back(path.back()->get_subcommands().back());
  return path;
}

std::string full_name(const std::vector<const CLI::App*>& path) {
  std::string name;
  for (const CLI::App* app : path) name += (name.empty() ? "" : " ") + app->get_name();
  return name;
}

// --long, or -s for an option without a long name. Options of parent commands are included because
// they fall through.
std::vector<std::string> option_names(const std::vector<const CLI::App*>& path) {
  std::vector<std::string> names;
  for (const CLI::App* app : path)
    for (const CLI::Option* option : app->get_options())
      if (!option->get_positional()) names.push_back(option->get_name());
  return names;
}

std::string unknown_command(const std::vector<const CLI::App*>& path, const std::string& word,
                            const std::vector<std::string>& commands) {
  const std::string name = full_name(path);
  if (word.empty())
    return fmt::format("a command is missing: {} {}; `{} --help` explains them", name,
                       listing(commands), name);
  return fmt::format("there is no command `{} {}`{}: choose {}", name, word,
                     nearest(word, commands), listing(commands));
}

std::string without_prefix(const std::string& text, const std::string& prefix) {
  return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : text;
}

// A message of CLI11 that begins with the long name of an option, with all names of that option:
// the user may have typed the short one.
std::string with_all_names(const std::vector<const CLI::App*>& path, const std::string& message) {
  const std::string name = message.substr(0, message.find_first_of(": "));
  for (const CLI::App* app : path)
    for (const CLI::Option* option : app->get_options())
      if (!option->get_positional() && option->get_name() == name)
        return option->get_name(false, true) + message.substr(name.size());
  return message;
}

bool is_option(const std::string& word) { return word.size() > 1 && word[0] == '-'; }

}  // namespace

CLI::Validator choice_of(std::vector<std::string> words) {
  return CLI::Validator(
      [words = std::move(words)](std::string& value) {
        const bool known = std::find(words.begin(), words.end(), value) != words.end();
        return known ? ""
                     : fmt::format("'{}' is not a valid choice: choose {}", value, listing(words));
      },
      "");
}

CLI::Validator number_in(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        const auto value = decimal_number(text);
        const bool in_range = value && *value >= low && *value <= high;
        return in_range ? "" : fmt::format("'{}' is not a number from {} to {}", text, low, high);
      },
      "");
}

CLI::Validator zero_or_in(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        const auto value = decimal_number(text);
        const bool fits = value && (*value == 0 || (*value >= low && *value <= high));
        return fits ? ""
                    : fmt::format("'{}' is neither 0 nor a number from {} to {}", text, low, high);
      },
      "");
}

CLI::Validator path_given() {
  return CLI::Validator(
      [](std::string& path) { return path.empty() ? "the path is empty; give one" : ""; }, "");
}

CLI::Validator list_entry() {
  return CLI::Validator(
      [](std::string& entry) {
        const bool option = entry.size() > 1 && entry[0] == '-' && !std::isdigit(uint8_t(entry[1]));
        return option ? fmt::format("'{}' is an option, but a list entry is expected", entry) : "";
      },
      "");
}

void add_strict(CLI::App& command, Undrawable& undrawable) {
  command.add_flag_callback(
      "--strict", [&undrawable] { undrawable = Undrawable::refused; },
      "Reject a splat file with Gaussians that cannot be drawn (NaN, Inf or the rotation 0 0 0 0) "
      "instead of leaving them out");
}

std::string sentence_for(const CLI::App& app, const CLI::ParseError& problem) {
  const std::vector<const CLI::App*> path = understood(app);
  std::vector<std::string> commands;
  for (const CLI::App* command : path.back()->get_subcommands({}))
    commands.push_back(command->get_name());
  const std::vector<std::string> extras = app.remaining(true);
  const auto word = std::find_if_not(extras.begin(), extras.end(), is_option);
  const bool missing = extras.empty() && dynamic_cast<const CLI::RequiredError*>(&problem);
  if (!commands.empty() && (word != extras.end() || missing))
    return unknown_command(path, word == extras.end() ? "" : *word, commands);
  const std::string name = full_name(path);
  if (dynamic_cast<const CLI::ConversionError*>(&problem))
    return fmt::format("{}: not a number that this option accepts (see `{} --help`)",
                       with_all_names(path, without_prefix(problem.what(), "Could not convert: ")),
                       name);
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&problem)) {
    const std::string said = problem.what(), option = said.substr(0, said.find(':'));
    if (said.find(": At Most 1 required") == option.size())
      return fmt::format("{} is given twice (see `{} --help`)", with_all_names(path, option), name);
  }
  if (extras.empty())
    return fmt::format("{} (see `{} --help`)", with_all_names(path, problem.what()), name);
  if (!is_option(extras[0]))
    return fmt::format("`{}` got an unexpected argument '{}'", name, extras[0]);
  const std::string option = extras[0].substr(0, extras[0].find('='));
  return fmt::format("`{}` has no option {}{} (see `{} --help`)", name, option,
                     nearest(option, option_names(path)), name);
}

}  // namespace gflow
