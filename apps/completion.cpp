// SPDX-License-Identifier: Apache-2.0
// `gflow completion`: scripts for the completion of bash and zsh, from the command line as CLI11
// knows it.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#ifdef GFLOW_WITH_OPENCV
#include "optim/options/train_options.hpp"
#endif

namespace gflow {
namespace {

std::vector<std::string> setting_names() {
  std::vector<std::string> names;
#ifdef GFLOW_WITH_OPENCV
  for (const SettingInWords& setting : settings_in_words({})) names.push_back(setting.name);
#endif
  return names;
}

// "--output" of an option "-o,--output"; "" for a positional one.
std::string long_name(const CLI::Option& option) {
  return option.get_lnames().empty() ? "" : "--" + option.get_lnames().front();
}

// Options of a command and those of every command.
std::vector<const CLI::Option*> options_of(const CLI::App& command) {
  std::vector<const CLI::Option*> options = command.get_options();
  for (const CLI::App* above = command.get_parent(); above; above = above->get_parent())
    for (const CLI::Option* option : above->get_options())
      if (long_name(*option) == "--device" || long_name(*option) == "--quiet")
        options.push_back(option);
  return options;
}

// Calls visit(path, command) for the program and all commands below it; path: "bench skip".
template <class Visit>
void for_each_command(const CLI::App& app, const std::string& path, Visit&& visit) {
  visit(path, app);
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    for_each_command(*command,
                     path.empty() ? command->get_name() : path + " " + command->get_name(), visit);
}

// All commands as a pattern of `case`: 'train'|'bench'|'bench skip'.
std::string command_paths(const CLI::App& app) {
  std::vector<std::string> paths;
  for_each_command(app, "", [&](const std::string& path, const CLI::App&) {
    if (!path.empty()) paths.push_back("'" + path + "'");
  });
  return fmt::format("      {}", fmt::join(paths, "|"));
}

// Words, not options, are the command: `gflow bench skip --json a` completes as "bench skip".
std::string bash_script(const CLI::App& app) {
  std::string cases;
  for_each_command(app, "", [&](const std::string& path, const CLI::App& command) {
    std::vector<std::string> words;
    for (const CLI::App* below : command.get_subcommands([](const CLI::App*) { return true; }))
      words.push_back(below->get_name());
    for (const CLI::Option* option : options_of(command))
      if (const std::string name = long_name(*option); !name.empty()) words.push_back(name);
    cases += fmt::format("    '{}') words='{}' ;;\n", path, fmt::join(words, " "));
  });
  return fmt::format(R"(# bash completion of gflow, written by `gflow completion bash`
_gflow() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} command= words= k
  COMPREPLY=()
  if [ "${{COMP_WORDS[COMP_CWORD-1]}}" = --set ]; then
    compopt -o nospace
    COMPREPLY=($(compgen -S = -W '{}' -- "$word"))
    return
  fi
  for ((k = 1; k < COMP_CWORD; ++k)); do
    case "${{command:+$command }}${{COMP_WORDS[k]}}" in
{}) command="${{command:+$command }}${{COMP_WORDS[k]}}" ;;
    esac
  done
  case "$command" in
{}  esac
  [[ $word == -* || $words != -* ]] && COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _gflow gflow
)",
                     fmt::join(setting_names(), " "), command_paths(app), cases);
}

// Quotes text for zsh; brackets and colons separate the parts of its specifications.
std::string zsh_quoted(const std::string& text) {
  std::string quoted;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') quoted += '\\';
    quoted += c == '\n' ? ' ' : c;
    if (c == '\'') quoted += "\\''";
  }
  return quoted;
}

std::string zsh_action(const CLI::Option& option) {
  if (long_name(option) == "--set") return "setting:_gflow_settings";
  const bool is_flag = option.get_items_expected_max() == 0;
  return is_flag ? "" : "value:_files";
}

std::string zsh_script(const CLI::App& app) {
  std::string cases;
  for_each_command(app, "", [&](const std::string& path, const CLI::App& command) {
    const auto below = command.get_subcommands([](const CLI::App*) { return true; });
    cases += fmt::format("    '{}')\n", path);
    if (!below.empty()) {
      cases += "      commands=(\n";
      for (const CLI::App* one : below)
        cases +=
            fmt::format("        '{}:{}'\n", one->get_name(), zsh_quoted(one->get_description()));
      cases += "      )\n";
    }
    cases += "      options=(\n";
    for (const CLI::Option* option : options_of(command)) {
      const std::string name = long_name(*option), action = zsh_action(*option);
      if (name.empty()) continue;
      cases += fmt::format("        '*{}[{}]{}'\n", name, zsh_quoted(option->get_description()),
                           action.empty() ? "" : ":" + action);
    }
    cases += "      ) ;;\n";
  });
  return fmt::format(R"(#compdef gflow
# zsh completion of gflow, written by `gflow completion zsh`
_gflow_settings() {{
  local -a names=({})
  compadd -S = -a names
}}
_gflow() {{
  local command= word
  local -a commands options
  for word in ${{words[2,CURRENT-1]}}; do
    case "${{command:+$command }}$word" in
{}) command="${{command:+$command }}$word" ;;
    esac
  done
  case "$command" in
{}  esac
  if (( $#commands )) && [[ $words[CURRENT] != -* ]]; then
    _describe command commands
  else
    _arguments $options '*:file:_files'
  fi
}}
_gflow "$@"
)",
                     fmt::join(setting_names(), " "), command_paths(app), cases);
}

}  // namespace

void add_completion(CLI::App& app, const GlobalOptions&) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "completion", "Print a script that completes gflow's command line in bash or zsh");
  command->add_option("SHELL", *shell, "bash or zsh")
      ->required()
      ->check(choice_of({"bash", "zsh"}))
      ->type_name("SHELL");
  command->callback(
      [&app, shell] { fmt::print("{}", *shell == "bash" ? bash_script(app) : zsh_script(app)); });
}

}  // namespace gflow
