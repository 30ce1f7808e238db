// SPDX-License-Identifier: Apache-2.0
// Results of an experiment as tables and plots. Identical trainings give identical bytes, except
// for costs.md, runs.csv and the metrics `minutes` and `memory`.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/common/plot.hpp"
#include "apps/experiments/metrics.hpp"
#include "apps/experiments/plan.hpp"

namespace gflow::experiments {

// results.json of each run that is finished with the plan's settings; null for the others.
std::vector<nlohmann::json> results_of(const Plan& plan, const std::string& folder);

// A metric of a row, over its seeds.
struct Cell {
  std::vector<double> values;  // of the finished runs that have it
  bool no_model = false;       // no run has a value, at least one because no network was given
  double mean() const;         // NaN without values
  double spread() const;       // standard deviation over the runs (n - 1); NaN for fewer than two
};

// A table to be written as Markdown or for a page.
struct Table {
  struct Entry {
    std::string value;               // "-" without one
    std::string spread, difference;  // over seeds, and to the baseline; may be empty
    bool best = false;               // among the rows that it is compared with
  };
  struct Row {
    std::vector<std::string> names;  // scene, then one choice per axis
    std::vector<Entry> entries;      // one per metric
  };
  std::vector<std::string> head;  // of the names, then of the metrics
  std::vector<Row> rows;
};

class Results {
 public:
  Results(const Plan& plan, std::vector<nlohmann::json> results);

  // One line per row. With several scenes, one more per combination of choices: the mean over
  // scenes of each seed that all scenes have, and the spread of these means. Among rows with the
  // same baseline the best value is bold; brackets contain the difference to the baseline.
  std::string markdown() const;
  // Its rows, and the sentences above them.
  Table table() const { return table_of(metrics_, true); }
  std::string summary() const;
  // The same for training costs.
  std::string costs() const;
  Table cost_table() const;
  std::string csv() const;       // means and spreads, one line per row
  std::string runs_csv() const;  // every metric of every run
  nlohmann::ordered_json json() const;

  // The metrics of the table.
  const std::vector<Metric>& metrics() const { return metrics_; }

  // Bar plots of a metric over all rows with their spread, scene by scene.
  std::vector<Plot> bars() const;
  // PSNR during training (metrics.jsonl) over steps and seconds, for the first seeds.
  std::vector<Plot> curves(const std::string& folder) const;

 private:
  struct Line {
    Row row;
    std::vector<Cell> cells;  // one per metric of `metrics_`
  };
  // marks: whether the best value and differences to the baseline are marked.
  Table table_of(const std::vector<Metric>& metrics, bool marks) const;
  std::vector<Line> lines_of(const std::vector<Metric>& metrics) const;

  const Plan& plan_;
  std::vector<nlohmann::json> results_;
  std::vector<Metric> metrics_;
};

// Throws an Error if no scene has the test views of a film at any of its steps.
void require_films(const Plan& plan);

// Writes the compare.png of the first seed of each row below each other as
// FOLDER/pictures/SCENE.png, and the requested films, truth first, as SCENE_VIEW_FIRST-LAST.png
// where the scene has these views. Returns the written files.
std::vector<std::string> write_contact_sheets(const Plan& plan, const std::string& folder);

}  // namespace gflow::experiments
