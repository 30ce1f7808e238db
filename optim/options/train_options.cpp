// SPDX-License-Identifier: Apache-2.0
// Assigns, checks and prints settings, and finds the nearest name.
#include "optim/options/train_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <type_traits>

#include "runtime/base/decimal.hpp"
#include "runtime/base/edit_distance.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/file_address.hpp"
#include "runtime/files/toml_file.hpp"

namespace gflow {
namespace {

std::string toml_text(bool value) { return value ? "true" : "false"; }
std::string toml_text(int value) { return fmt::format("{}", value); }
std::string toml_text(int64_t value) { return fmt::format("{}", value); }
// The shortest text that reads back as the same float; TOML tells floats from integers by a point
// or exponent.
std::string toml_text(float value) {
  std::string text = fmt::format("{}", value);
  if (std::isfinite(value) && text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}
// A path that is not UTF-8, which TOML requires, is written as a file address.
std::string toml_text(const std::string& value) {
  if (!is_utf8(value) || is_file_address(value)) return '"' + file_address(value) + '"';
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') text += '\\';
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
      text += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      text += c;
  }
  return text + '"';
}
template <class Enum, std::enable_if_t<std::is_enum_v<Enum>, int> = 0>
std::string toml_text(Enum value) {
  return fmt::format("\"{}\"", name_of(value));
}

// Allowed values of a setting by type, for messages and for comments of the file.
std::string allowed(bool) { return "true or false"; }
std::string allowed(const std::string&) { return ""; }
template <class Number, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
std::string allowed(Number, const Allowed& range) {
  return range.text();
}
template <class Enum, std::enable_if_t<std::is_enum_v<Enum>, int> = 0>
std::string allowed(Enum value) {
  return fmt::format("{}", fmt::join(names_of(value), ", "));
}

// A value for a setting. `text` is set if it comes from --set, where quotes are optional.
struct Incoming {
  std::string where;  // "run.toml, line 7" or "--set"
  std::string name;   // "train.iterations"
  const toml::node* node;
  std::optional<std::string> text;

  std::string shown() const {
    if (text) return text->empty() ? "nothing" : excerpt(*text);
    if (node->is_array()) return "a list";
    std::ostringstream out;
    node->visit([&](const auto& value) { out << value; });
    return excerpt(out.str());
  }
  [[noreturn]] void refuse(const std::string& allowed) const {
    throw Error(
        fmt::format("{}: {} = {} is not allowed; it must be {}", where, name, shown(), allowed));
  }
};

void assign(const Incoming& in, bool& member) {
  const auto value = in.node->value_exact<bool>();
  if (!value) in.refuse(allowed(member));
  member = *value;
}

// A list of texts, ["cam03", "cam13"], as the settings that take several names want them: with
// commas.
std::optional<std::string> joined_texts(const toml::node& node) {
  const toml::array* list = node.as_array();
  if (!list || list->empty()) return std::nullopt;
  std::string text;
  for (const toml::node& entry : *list) {
    const auto word = entry.value_exact<std::string>();
    if (!word) return std::nullopt;
    text += (text.empty() ? "" : ",") + *word;
  }
  return text;
}

void assign(const Incoming& in, std::string& member) {
  auto value = in.node->value_exact<std::string>();
  if (!value) value = joined_texts(*in.node);
  if (!value && !in.text) in.refuse("text in quotes");
  member = value ? *value : *in.text;
  if (!is_file_address(member)) return;
  const auto path = path_of_address(member);
  if (!path) in.refuse("a file:// URL, where %XX is a byte and %25 a percent sign");
  member = *path;
}

template <class Integer, std::enable_if_t<std::is_integral_v<Integer>, int> = 0>
void assign(const Incoming& in, Integer& member, const Allowed& range) {
  const auto value = in.node->value_exact<int64_t>();
  constexpr Integer most = std::numeric_limits<Integer>::max();
  const auto beyond = in.node->is_floating_point() ? in.node->value<double>() : std::nullopt;
  if (((value && *value > most) || (beyond && *beyond > double(most))) &&
      range.contains(int64_t(most)))
    in.refuse(fmt::format("a whole number, at most {}", most));
  if (!value || *value < std::numeric_limits<Integer>::min() || !range.contains(*value))
    in.refuse("a whole number, " + range.text());
  member = static_cast<Integer>(*value);
}

void assign(const Incoming& in, float& member, const Allowed& range) {
  const auto value = in.node->is_number() ? in.node->value<double>() : std::nullopt;
  constexpr double most = std::numeric_limits<float>::max();
  if (value && *value > most && range.contains(most))
    in.refuse(fmt::format("a number, at most {:.3g}", most));
  const bool is_text = in.node->is_string();  // text such as 0x1p-2 may parse as a number elsewhere
  if (!value || !range.contains(*value))
    in.refuse((is_text ? "a decimal number, " : "a number, ") + range.text());
  member = static_cast<float>(*value);
}

// Renamed values: setting, former and current value.
struct RenamedValue {
  std::string_view name, former, current;
};
constexpr RenamedValue kRenamedValues[] = {{"scene.masks", "all", "alpha"}};

std::string present_value(const Incoming& in, const std::string& word) {
  for (const RenamedValue& renamed : kRenamedValues)
    if (in.name == renamed.name && word == renamed.former) return std::string(renamed.current);
  return word;
}

template <class Enum, std::enable_if_t<std::is_enum_v<Enum>, int> = 0>
void assign(const Incoming& in, Enum& member) {
  const auto names = names_of(member);
  const auto value = in.node->value_exact<std::string>();
  const std::string word = present_value(in, value ? *value : in.text.value_or(""));
  const auto found = std::find(names.begin(), names.end(), word);
  if (found == names.end()) in.refuse("one of " + allowed(member));
  member = static_cast<Enum>(found - names.begin());
}

// Calls visit("section", "key", member, help[, range]) for every setting.
template <class Config, class Visit>
void for_each_setting(Config& config, Visit&& visit) {
  TrainOptions::sections(config, [&](const char* section, auto& part, const char*) {
    std::decay_t<decltype(part)>::fields(
        part, [&](const char* key, auto& member, const Help& help, const auto&... range) {
          visit(std::string(section), std::string(key), member, help, range...);
        });
  });
}

// End of a message about an unknown name: the nearest name, if one is near. marks: around names,
// "[]" or "''".
std::string nearest_in_words(const std::string& name, const std::string& nearest, bool is_near,
                             const std::string& marks) {
  const std::string known = is_near ? "the nearest is " + marks.substr(0, 1) + nearest + marks[1]
                                    : "`gflow settings` lists them";
  return fmt::format("{}{}{}; {}", marks[0], excerpt(name), marks[1], known);
}

// Distance: the key counts twice and the section at most 3, so that a right key in a wrong section
// is found. A key that is a section means its weight: loss.flow is near flow.weight.
std::string nearest_setting(const std::string& name, const std::string& section,
                            const std::string& key) {
  std::string nearest;
  size_t best = std::numeric_limits<size_t>::max(), of_key = best;
  TrainOptions config;
  for_each_setting(
      config, [&](const std::string& its_section, const std::string& its_key, auto&&...) {
        const bool is_weight = key == its_section && its_key == "weight";
        const size_t keys = is_weight ? 0 : edit_distance(key, its_key);
        const size_t distance = 2 * keys + std::min<size_t>(edit_distance(section, its_section), 3);
        if (distance >= best) return;
        best = distance;
        of_key = keys;
        nearest = its_section + "." + its_key;
      });
  return nearest_in_words(name, nearest, 2 * of_key <= key.size(), "''");
}

std::string nearest_section(const std::string& name) {
  std::string nearest;
  size_t best = std::numeric_limits<size_t>::max();
  TrainOptions config;
  TrainOptions::sections(config, [&](const char* section, auto&, const char*) {
    const size_t distance = edit_distance(name, section);
    if (distance >= best) return;
    best = distance;
    nearest = section;
  });
  return nearest_in_words(name, nearest, 2 * best <= name.size(), "[]");
}

// Renamed settings, which older files may contain: former and current name.
constexpr std::pair<std::string_view, std::string_view> kRenamed[] = {
    {"motion.rest", "motion.static_threshold"},
    {"motion.rest_every", "motion.static_every"},
    {"motion.rest_wake", "motion.wake_threshold"},
    {"hexplane.unfold", "hexplane.curriculum"},
    {"flow.reach", "flow.span"},
    {"flow.far", "flow.long_span"},
    {"flow.far_share", "flow.long_share"},
    {"flow.calm", "flow.low_motion"},
    {"flow.calm_px", "flow.low_motion_px"},
    {"guidance.pictures", "guidance.images"},
    {"guidance.time_out", "guidance.timeout"},
    {"skip.asking", "skip.zero_gradients"},
    {"skip.still", "skip.static_pose"},
    {"skip.outside", "skip.culled"},
};

// Settings of earlier versions that have no effect any more.
constexpr std::string_view kRemoved[] = {"skip.compact"};

void note_once(const std::string& name, const std::string& sentence) {
  static std::set<std::string> noted;
  if (noted.insert(name).second) warn(sentence);
}

// Current section and key of a setting; prints a notice once per renamed setting.
std::pair<std::string, std::string> present_name(const std::string& section,
                                                 const std::string& key) {
  const std::string name = section + "." + key;
  for (const auto& [former, present] : kRenamed) {
    if (name != former) continue;
    note_once(name, fmt::format("the setting {} was renamed to {}; the old name still works", name,
                                present));
    const size_t dot = present.find('.');
    return {std::string(present.substr(0, dot)), std::string(present.substr(dot + 1))};
  }
  return {section, key};
}

void assign_setting(TrainOptions& config, const std::string& given_section,
                    const std::string& given_key, Incoming in) {
  const std::pair<std::string, std::string> present = present_name(given_section, given_key);
  const std::string &section = present.first, &key = present.second;
  in.name = section.empty() ? key : section + "." + key;
  if (std::find(std::begin(kRemoved), std::end(kRemoved), in.name) != std::end(kRemoved))
    return note_once(in.name,
                     fmt::format("the setting {} no longer exists and is ignored", in.name));
  bool known = false;
  for_each_setting(config, [&](const std::string& its_section, const std::string& its_key,
                               auto& member, const Help&, const auto&... range) {
    if (section != its_section || key != its_key) return;
    assign(in, member, range...);
    known = true;
  });
  TrainOptions::sections(config, [&](const char* its_name, auto&, const char*) {
    if (section.empty() && key == its_name)
      throw Error(
          fmt::format("{}: '{}' is a section: write its settings below [{}], or as {}.SETTING",
                      in.where, key, key, key));
  });
  if (!known)
    throw Error(fmt::format("{}: there is no setting {}", in.where,
                            nearest_setting(in.name, section, key)));
}

// Parses the text of --set as TOML, else as a number (.5), else as plain text.
toml::table value_table(const std::string& text) {
  try {
    return parse_toml("value = " + text, "--set");
  } catch (const toml::parse_error&) {
    if (const auto number = decimal_number(text)) return toml::table{{"value", *number}};
    return toml::table{{"value", text}};
  }
}

template <class Member>
void check_value(const std::string&, const Member&) {}
template <class Number>
void check_value(const std::string& name, const Number& value, const Allowed& range) {
  using Widest = std::conditional_t<std::is_integral_v<Number>, int64_t, double>;
  if (!range.contains(static_cast<Widest>(value)))
    throw Error(
        fmt::format("{} = {} is not allowed; it must be {}", name, toml_text(value), range.text()));
}

// parse() gives the table or throws toml::parse_error.
template <class Parse>
void apply_toml(TrainOptions& config, const std::string& path, Parse&& parse) {
  toml::table file;
  try {
    file = parse();
  } catch (const toml::parse_error& problem) {
    throw Error("reading the configuration " + toml_problem(path, problem));
  }
  const auto where = [&](const toml::node& node) {
    return fmt::format("{}, line {}", path, node.source().begin.line);
  };
  for (const auto& [section, node] : file) {
    const std::string name(section.str());
    const toml::table* table = node.as_table();
    if (!table) assign_setting(config, "", name, {where(node), "", &node, {}});
    bool known = false;
    TrainOptions::sections(
        config, [&](const char* its_name, auto&, const char*) { known |= name == its_name; });
    if (!known && table->empty())
      throw Error(fmt::format("{}: there is no section {}", where(node), nearest_section(name)));
    for (const auto& [key, value] : *table)
      assign_setting(config, name, std::string(key.str()), {where(value), "", &value, {}});
  }
}

}  // namespace

EngineSettings engine_settings(const TrainOptions& config) {
  const FlowOptions& flow = config.flow;
  EngineSettings settings;
  settings.skip = config.skip;
  settings.defines = config.defines;
  settings.transport = flow.transport;
  settings.stop = flow.stop;
  settings.top_k = flow.top_k;
  settings.detach_t1 = flow.detach_t1;
  settings.detach_weights = flow.detach_weights;
  settings.absgrad = config.density.strategy == DensityKind::adc && config.density.absgrad;
  return settings;
}

void apply_file(TrainOptions& config, const std::string& path) {
  apply_toml(config, path, [&] { return read_toml(path); });
}

void apply_text(TrainOptions& config, const std::string& text, const std::string& name) {
  apply_toml(config, name, [&] { return parse_toml(text, name); });
}

void apply_setting(TrainOptions& config, const std::string& assignment) {
  const size_t equals = assignment.find('=');
  const size_t dot = assignment.substr(0, equals).find('.');
  const std::string where = "--set " + excerpt(assignment);
  const auto require_both = [&](bool both) {
    if (!both)
      throw Error(where +
                  ": a setting is written section.key=value, for example train.iterations=3000");
  };
  require_both(equals != std::string::npos && dot != std::string::npos);
  const auto trimmed = [](const std::string& text) {
    const size_t first = text.find_first_not_of(" \t");
    return first == std::string::npos
               ? std::string()
               : text.substr(first, text.find_last_not_of(" \t") - first + 1);
  };
  const std::string section = trimmed(assignment.substr(0, dot));
  const std::string key = trimmed(assignment.substr(dot + 1, equals - dot - 1));
  const std::string text = trimmed(assignment.substr(equals + 1));
  require_both(!section.empty() && !key.empty());
  const toml::table table = value_table(text);
  if (table.size() != 1)
    throw Error(where + ": it has more than one setting; use one --set for each");
  assign_setting(config, section, key, {where, "", table.get("value"), text});
}

void check(const TrainOptions& config) {
  for_each_setting(config, [](const std::string& section, const std::string& key,
                              const auto& member, const Help&, const auto&... range) {
    check_value(section + "." + key, member, range...);
  });
}

namespace {

// Whether a motion model of this name is not registered from outside.
bool comes_with_gflow(const std::string& name) {
  for (int kind = 0; kind <= int(MotionModelKind::nodes); ++kind)
    if (name == motion_model_of(MotionModelKind(kind)).name) return true;
  return false;
}

}  // namespace

std::string to_toml(const TrainOptions& config) {
  std::string text =
      "# Every setting of this run. Use it again with: gflow train SCENE -o RUN --config FILE\n";
  TrainOptions::sections(config, [&](const char* section, auto& part, const char* help) {
    // A program without a registered model does not know its section, but may read the file
    // otherwise.
    if (std::is_same_v<std::decay_t<decltype(part)>, OwnNumbers> && !comes_with_gflow(section) &&
        section != std::string(name_of(config.motion.model)))
      return;
    text += fmt::format("\n[{}]  # {}\n", section, help);
    std::decay_t<decltype(part)>::fields(
        part, [&](const char* key, auto& member, const Help& help, const auto&... range) {
          const std::string values = allowed(member, range...);
          text += fmt::format("{:<28}  # {}{}\n", fmt::format("{} = {}", key, toml_text(member)),
                              help.text, values.empty() ? "" : " (" + values + ")");
        });
  });
  return text;
}

std::vector<SettingInWords> settings_in_words(const TrainOptions& config) {
  std::vector<SettingInWords> all;
  for_each_setting(config, [&](const std::string& section, const std::string& key,
                               const auto& member, const Help& help, const auto&... range) {
    all.push_back({section + "." + key, toml_text(member), help.text, allowed(member, range...),
                   help.advanced});
  });
  return all;
}

std::map<std::string, std::string> setting_values(const TrainOptions& config) {
  std::map<std::string, std::string> values;
  for (SettingInWords& setting : settings_in_words(config))
    values[setting.name] = std::move(setting.value);
  return values;
}

}  // namespace gflow
