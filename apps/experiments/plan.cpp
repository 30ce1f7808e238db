// SPDX-License-Identifier: Apache-2.0
#include "apps/experiments/plan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>

#include "apps/experiments/metrics.hpp"
#include "optim/options/quality.hpp"
#include "runtime/base/printable.hpp"
#include "runtime/base/utf8.hpp"
#include "runtime/files/file_address.hpp"
#include "runtime/files/toml_file.hpp"

namespace gflow::experiments {
namespace {

namespace fs = std::filesystem;

struct Setting {
  std::string key, value;  // section.key, as TOML
  std::string where;       // file and line
};

// A scene or one choice of an axis.
struct Choice {
  std::string name;
  std::vector<Setting> settings;
};

struct Axis {
  std::string name;
  std::vector<Choice> choices;
};

class Reader {
 public:
  Reader(const std::string& path, const std::string& scenes) : path_(path), scenes_(scenes) {}

  Plan read() {
    try {
      file_ = read_toml(path_);
    } catch (const toml::parse_error& problem) {
      throw Error("reading " + toml_problem(path_, problem));
    }
    expect_keys(file_, {"title", "scenes", "seeds", "config", "metrics", "baseline", "films",
                        "settings", "axis", "variant"});
    Plan plan;
    plan.path = path_;
    plan.title = text_or(file_, "title", fs::path(path_).stem().string());
    plan.metrics = metrics();
    plan.films = films();
    const TrainOptions base = base_config();
    const std::vector<Axis> axes = read_axes();
    for (const Axis& axis : axes) plan.axes.push_back(axis.name);
    plan.baseline = baseline(axes);
    const std::vector<Choice> scenes = read_scenes();
    expect_few_runs(scenes.size(), seeds().size(), axes);
    for (const Choice& scene : scenes) add_rows(plan, base, scene, axes);
    expect_distinct(plan.runs);
    return plan;
  }

 private:
  std::string at(const toml::node& node) const {
    const auto line = node.source().begin.line;
    return line == 0 ? path_ : fmt::format("{}, line {}", path_, line);
  }

  void expect_keys(const toml::table& table, const std::vector<std::string>& known) const {
    for (const auto& [key, node] : table)
      if (std::find(known.begin(), known.end(), key.str()) == known.end())
        throw Error(fmt::format("{}: unknown key '{}'; known are {}", at(node),
                                excerpt(std::string(key.str())), fmt::join(known, ", ")));
  }

  std::string text(const toml::node& node, const std::string& name) const {
    if (const auto value = node.value<std::string>(); value && !value->empty()) return *value;
    throw Error(fmt::format("{}: '{}' must be a non-empty string", at(node), name));
  }
  std::string text_or(const toml::table& table, const char* key, const std::string& other) const {
    const toml::node* node = table.get(key);
    return node ? text(*node, key) : other;
  }

  const toml::array& list(const toml::node& node, std::string_view name) const {
    const toml::array* list = node.as_array();
    if (list && !list->empty()) return *list;
    throw Error(fmt::format("{}: '{}' must be a non-empty list", at(node), name));
  }

  const toml::table& table(const toml::node& node, std::string_view name) const {
    if (const toml::table* table = node.as_table()) return *table;
    throw Error(fmt::format("{}: {} must be a table", at(node), name));
  }

  std::string value_text(const toml::node& node, const std::string& key) const {
    if (const auto* value = node.as_string()) return nlohmann::json(value->get()).dump();
    if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
    if (const auto* value = node.as_integer()) return fmt::format("{}", value->get());
    if (const auto* value = node.as_floating_point()) return fmt::format("{}", value->get());
    throw Error(
        fmt::format("{}: '{}' must be a number, a string, true or false", at(node), excerpt(key)));
  }

  // The settings of a table, without the table's own keys.
  std::vector<Setting> settings_of(const toml::table& table,
                                   const std::vector<std::string>& others = {},
                                   const std::string& before = "") const {
    std::vector<Setting> settings;
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      if (before.empty() && std::find(others.begin(), others.end(), name) != others.end()) continue;
      if (const toml::table* inner = node.as_table()) {
        const auto more = settings_of(*inner, {}, before + name + ".");
        settings.insert(settings.end(), more.begin(), more.end());
      } else {
        const std::string whole = before + name;
        if (whole == "train.seed" || whole == "scene.path")
          throw Error(fmt::format("{}: '{}' cannot be set in an experiment; use the list '{}'",
                                  at(node), whole, whole == "train.seed" ? "seeds" : "scenes"));
        settings.push_back({whole, value_text(node, whole), at(node)});
      }
    }
    return settings;
  }

  std::vector<std::string> metrics() const {
    std::vector<std::string> names;
    const toml::node* node = file_.get("metrics");
    if (!node) return names;
    for (const toml::node& name : list(*node, "metrics")) {
      names.push_back(text(name, "metrics"));
      if (std::count(names.begin(), names.end(), names.back()) > 1)
        throw Error(
            fmt::format("{}: metric '{}' is listed twice", at(name), excerpt(names.back())));
      try {
        metric_named(names.back());
      } catch (const Error& problem) {
        throw Error(fmt::format("{}: {}", at(name), problem.what()));
      }
    }
    return names;
  }

  std::vector<Film> films() const {
    std::vector<Film> films;
    const toml::node* node = file_.get("films");
    if (!node) return films;
    for (const toml::node& entry : list(*node, "films")) {
      const std::string words = text(entry, "films");
      const size_t mark = words.rfind('@');
      const auto steps =
          mark == std::string::npos ? std::nullopt : step_range(words.substr(mark + 1));
      if (!steps || mark == 0)
        throw Error(fmt::format("{}: film '{}' must be VIEW@FIRST-LAST, for example cam00@9-13",
                                at(entry), excerpt(words)));
      films.push_back({words.substr(0, mark), steps->first, steps->second});
    }
    return films;
  }

  TrainOptions base_config() const {
    TrainOptions config;
    if (const toml::node* node = file_.get("config"))
      apply_file(config, (fs::path(path_).parent_path() / text(*node, "config")).string());
    if (const toml::node* node = file_.get("settings"))
      apply(config, {"", settings_of(table(*node, "[settings]"))});
    return config;
  }

  void apply(TrainOptions& config, const Choice& choice) const {
    for (const Setting& setting : choice.settings) try {
        if (setting.key == "quality") {
          const auto word = nlohmann::json::parse(setting.value);
          apply_quality(config, word.is_string() ? word.get<std::string>() : setting.value);
        } else {
          apply_setting(config, setting.key + "=" + setting.value);
        }
      } catch (const Error& problem) {
        std::string sentence = problem.what();
        const std::string option = fmt::format("--set {}={}: ", setting.key, setting.value);
        if (sentence.compare(0, option.size(), option) == 0) sentence.erase(0, option.size());
        throw Error(fmt::format("{}: {}", setting.where, sentence));
      }
  }

  std::vector<int64_t> seeds() const {
    const toml::node* node = file_.get("seeds");
    if (!node) return {0};
    std::vector<int64_t> seeds;
    for (const toml::node& seed : list(*node, "seeds")) {
      const auto* number = seed.as_integer();
      if (!number || number->get() < 0 || number->get() > kGreatestSeed)
        throw Error(
            fmt::format("{}: seeds must be whole numbers from 0 to {}", at(seed), kGreatestSeed));
      seeds.push_back(number->get());
    }
    return seeds;
  }

  std::vector<Choice> read_scenes() const {
    const toml::node* node = file_.get("scenes");
    if (!node) throw Error(fmt::format("{}: the list 'scenes' is missing", path_));
    std::vector<Choice> scenes;
    for (const toml::node& entry : list(*node, "scenes")) {
      Choice scene;
      const std::string where = at(entry);
      std::string path;
      if (const toml::table* fields = entry.as_table()) {
        const toml::node* named = fields->get("path");
        if (!named) throw Error(fmt::format("{}: a scene needs a 'path'", where));
        path = text(*named, "path");
        scene.name = text_or(*fields, "name", "");
        scene.settings = settings_of(*fields, {"path", "name"});
      } else {
        path = text(entry, "scenes");
      }
      const fs::path found = found_scene(path, where);
      if (scene.name.empty()) scene.name = found.stem().string();
      const std::string whole = found.string();
      const std::string as_text = is_utf8(whole) ? whole : file_address(whole);
      scene.settings.push_back({"scene.path", nlohmann::json(as_text).dump(), where});
      scenes.push_back(scene);
    }
    return scenes;
  }

  fs::path found_scene(const std::string& path, const std::string& where) const {
    std::vector<std::string> tried;
    for (const fs::path& from : {fs::path(path_).parent_path(), fs::path(scenes_)}) {
      fs::path whole = fs::absolute(from / path).lexically_normal();
      if (!whole.has_filename()) whole = whole.parent_path();  // the path ends with a slash
      if (fs::exists(whole)) return whole;
      if (tried.empty() || tried[0] != whole) tried.push_back(whole.string());
    }
    throw Error(fmt::format(
        "{}: scene '{}' not found: looked for {}; give the folder of the scenes with --scenes",
        where, excerpt(path), fmt::join(tried, " and ")));
  }

  Axis read_axis(const toml::table& fields) const {
    Axis axis;
    const toml::node* setting = fields.get("setting");
    if (setting) {
      expect_keys(fields, {"name", "setting", "values"});
      const std::string key = text(*setting, "setting");
      axis.name = text_or(fields, "name", key);
      const toml::node* values = fields.get("values");
      if (!values) throw Error(fmt::format("{}: the axis has no 'values'", at(fields)));
      for (const toml::node& value : list(*values, "values")) {
        const std::string as_toml = value_text(value, key);
        const auto* word = value.as_string();
        axis.choices.push_back({word ? word->get() : as_toml, {{key, as_toml, at(value)}}});
      }
      return axis;
    }
    expect_keys(fields, {"name", "choices"});
    const toml::node* choices = fields.get("choices");
    if (!choices || !fields.get("name"))
      throw Error(fmt::format("{}: an axis needs 'name' and 'choices', or 'setting' and 'values'",
                              at(fields)));
    axis.name = text(*fields.get("name"), "name");
    for (const toml::node& choice : list(*choices, "choices"))
      axis.choices.push_back(read_choice(table(choice, "a choice")));
    return axis;
  }

  Choice read_choice(const toml::table& fields) const {
    const toml::node* name = fields.get("name");
    if (!name) throw Error(fmt::format("{}: a choice or variant needs a 'name'", at(fields)));
    return {text(*name, "name"), settings_of(fields, {"name"})};
  }

  std::vector<Axis> read_axes() const {
    std::vector<Axis> axes;
    if (const toml::node* node = file_.get("axis"))
      for (const toml::node& axis : list(*node, "axis"))
        axes.push_back(read_axis(table(axis, "[[axis]]")));
    if (const toml::node* node = file_.get("variant")) {
      axes.push_back({"variant", {}});
      for (const toml::node& variant : list(*node, "variant"))
        axes.back().choices.push_back(read_choice(table(variant, "[[variant]]")));
    }
    std::set<std::string> names{"scene", "seed", "seeds", "run", "metrics"};  // in every table
    for (const Metric& metric : all_metrics()) names.insert({metric.name, metric.label});
    for (const Axis& axis : axes)
      if (!names.insert(axis.name).second)
        throw Error(fmt::format("{}: two columns would be named '{}'; rename the axis", path_,
                                excerpt(axis.name)));
    return axes;
  }

  std::vector<std::string> baseline(const std::vector<Axis>& axes) const {
    const toml::node* node = file_.get("baseline");
    if (!node) return {};
    if (axes.empty())
      throw Error(fmt::format("{}: 'baseline' selects a choice of each axis, but there is no axis",
                              at(*node)));
    std::vector<std::string> words;
    if (const toml::array* several = node->as_array())
      for (const toml::node& word : *several) words.push_back(text(word, "baseline"));
    else
      words.push_back(text(*node, "baseline"));
    bool known = words.size() == axes.size();
    for (size_t k = 0; known && k < axes.size(); ++k)
      known = words[k] == any_choice ||
              std::any_of(axes[k].choices.begin(), axes[k].choices.end(),
                          [&](const Choice& choice) { return choice.name == words[k]; });
    known &= std::any_of(words.begin(), words.end(),
                         [](const std::string& word) { return word != any_choice; });
    if (known) return words;
    std::vector<std::string> choices;
    for (const Axis& axis : axes) {
      std::vector<std::string> names;
      for (const Choice& choice : axis.choices) names.push_back(choice.name);
      choices.push_back(fmt::format("{} of {}", fmt::join(names, " | "), axis.name));
    }
    throw Error(
        fmt::format("{}: 'baseline' must have one choice of each axis in order, or \"{}\" for the "
                    "row's own: {}",
                    at(*node), any_choice, fmt::join(choices, ", ")));
  }

  // Limits the number of runs: the product of the axes may be arbitrarily large.
  void expect_few_runs(size_t scenes, size_t seeds, const std::vector<Axis>& axes) const {
    constexpr double most = 10000;
    double runs = double(scenes) * double(seeds);
    for (const Axis& axis : axes) runs *= double(axis.choices.size());
    if (runs > most)
      throw Error(
          fmt::format("{}: {} scenes, {} seeds and all combinations of {} axes make {:.4g} runs; "
                      "at most {} are allowed: remove choices or split the file",
                      path_, scenes, seeds, axes.size(), runs, most));
  }

  // The combinations of a scene; the last axis varies fastest.
  void add_rows(Plan& plan, const TrainOptions& base, const Choice& scene,
                const std::vector<Axis>& axes) const {
    size_t combinations = 1;
    for (const Axis& axis : axes) combinations *= axis.choices.size();
    for (size_t number = 0; number < combinations; ++number) {
      Row row{scene.name, {}};
      TrainOptions config = base;
      apply(config, scene);
      std::string id = scene.name;
      size_t share = combinations, rest = number;
      for (const Axis& axis : axes) {
        share /= axis.choices.size();
        const Choice& choice = axis.choices[rest / share];
        rest %= share;
        row.choices.push_back(choice.name);
        apply(config, choice);
        id += "-" + choice.name;
      }
      for (const int64_t seed : seeds()) {
        config.train.seed = seed;
        check(config);
        for (const std::string& network : {config.metrics.lpips, config.metrics.clip})
          if (!network.empty() && !fs::exists(network))
            throw Error(fmt::format("{}: there is no network '{}' for evaluation", path_,
                                    excerpt(network, 200)));
        plan.runs.push_back(
            {file_name(fmt::format("{}-seed{}", id, seed)), plan.rows.size(), config});
      }
      plan.rows.push_back(row);
    }
  }

  void expect_distinct(const std::vector<PlannedRun>& runs) const {
    constexpr size_t longest = 200;  // file systems allow 255 bytes, and suffixes follow
    std::set<std::string> ids;
    for (const PlannedRun& run : runs) {
      if (run.id.size() > longest)
        throw Error(
            fmt::format("{}: the name of the run folder {} has {} characters; at most {} are "
                        "allowed: shorten the names of scenes and choices",
                        path_, excerpt(run.id), run.id.size(), longest));
      if (!ids.insert(run.id).second)
        throw Error(fmt::format(
            "{}: two runs would be named {}: rename scenes or choices, and list each seed once",
            path_, run.id));
    }
  }

  std::string path_, scenes_;
  toml::table file_;
};

}  // namespace

std::string file_name(std::string text) {
  for (char& c : text)
    if (!std::isalnum(static_cast<unsigned char>(c)) &&
        std::string("+-._").find(c) == std::string::npos)
      c = '_';
  return text;
}

std::string name_of(const Row& row, const std::string& without) {
  return row.choices.empty() ? without : fmt::format("{}", fmt::join(row.choices, ", "));
}

bool is_first_seed(const Plan& plan, size_t run) {
  return run == 0 || plan.runs[run - 1].row != plan.runs[run].row;
}

Plan read_plan(const std::string& path, const std::string& scenes) {
  return Reader(path, scenes).read();
}

}  // namespace gflow::experiments
