// SPDX-License-Identifier: Apache-2.0
// `gflow settings`: lists the settings of training.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/common/help_text.hpp"
#include "apps/common/options.hpp"
#include "optim/options/train_options.hpp"
#include "runtime/base/edit_distance.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace {

// Settings whose name contains the word. Advanced settings are included if `all_levels` is set or a
// word is given. If none matches, throws an Error that names the nearest setting if one is near.
std::vector<SettingInWords> settings_named(const std::string& word, bool all_levels) {
  const std::vector<SettingInWords> all = settings_in_words({});
  std::vector<SettingInWords> found;
  std::copy_if(all.begin(), all.end(), std::back_inserter(found), [&](const auto& s) {
    const bool shown = all_levels || !word.empty() || !s.advanced;
    return shown && s.name.find(word) != std::string::npos;
  });
  if (!found.empty()) return found;
  const auto apart = [&](const SettingInWords& s) {  // to the whole name or a part of it
    const size_t dot = s.name.find('.');
    return std::min({edit_distance(s.name, word), edit_distance(s.name.substr(0, dot), word),
                     edit_distance(s.name.substr(dot + 1), word)});
  };
  const auto nearest = std::min_element(
      all.begin(), all.end(), [&](const auto& a, const auto& b) { return apart(a) < apart(b); });
  // As for --set, half of the letters of a key may differ: section.key also has a right section.
  const size_t letters = word.size() - (word.rfind('.') + 1);  // npos + 1 is 0
  throw Error(fmt::format("settings {}: no setting has this in its name; {}", excerpt(word),
                          2 * apart(*nearest) <= letters ? "the nearest is " + nearest->name
                                                         : "`gflow settings --all` lists them"));
}

// What each section of settings is about, by its name.
std::map<std::string, std::string> section_meanings() {
  std::map<std::string, std::string> meanings;
  TrainOptions config;
  TrainOptions::sections(config, [&](const char* name, const auto&, const char* meaning) {
    meanings[name] = meaning;
  });
  return meanings;
}

// The settings below the headings of their sections.
std::string table_of(const std::vector<SettingInWords>& settings) {
  constexpr size_t column = 34;  // of the meanings
  const std::map<std::string, std::string> meanings = section_meanings();
  std::string text, section;
  for (const SettingInWords& s : settings) {
    const std::string its_section = s.name.substr(0, s.name.find('.'));
    if (its_section != section)
      text += fmt::format("{}[{}]  {}\n", text.empty() ? "" : "\n", its_section,
                          meanings.at(its_section));
    section = its_section;
    const std::string allowed = s.allowed.empty() ? "" : ". Allowed: " + s.allowed;
    text += two_columns(fmt::format("{} = {}", s.name, s.value), s.meaning + allowed, column);
  }
  return text;
}

}  // namespace

void add_settings(CLI::App& app, const GlobalOptions&) {
  struct Flags {
    std::string word;
    bool json = false, all = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* command = app.add_subcommand(
      "settings", "List the settings of training: default, meaning, unit, allowed values");
  command
      ->add_option("WORD", flags->word, "Only settings with this in their name, e.g. flow. or rate")
      ->type_name("WORD");
  command->add_flag("--all", flags->all, "Include advanced settings (always included with WORD)");
  command->add_flag("--json", flags->json, "Print JSON");
  command->callback([flags] {
    const std::vector<SettingInWords> found = settings_named(flags->word, flags->all);
    if (flags->json) {
      nlohmann::ordered_json all = nlohmann::ordered_json::object();
      for (const SettingInWords& s : found)
        all[s.name] = {{"default", s.value}, {"meaning", s.meaning}, {"allowed", s.allowed}};
      fmt::print("{}\n", all.dump(1));
      return;
    }
    const size_t total = settings_in_words({}).size();
    fmt::print("{}\n{} of {} settings{}\n", table_of(found), found.size(), total,
               found.size() < total && flags->word.empty() ? "; --all shows the rest" : "");
  });
}

}  // namespace gflow
