// SPDX-License-Identifier: Apache-2.0
// What came of an experiment, as tables and plots. Of the same trainings the same bytes, but for
// costs.md, runs.csv and where `minutes` or `memory` are asked for.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/common/plot.hpp"
#include "apps/experiments/metrics.hpp"
#include "apps/experiments/plan.hpp"

namespace gflow::experiments {

// results.json of each run that is finished with the plan's settings; null of the others.
std::vector<nlohmann::json> results_of(const Plan& plan, const std::string& folder);

// A figure of a row, over its seeds.
struct Cell {
  std::vector<double> values;  // of the finished runs that have it
  bool no_model = false;       // no run has it, one because it was given no network
  double mean() const;         // NaN where there is none
  double spread() const;       // standard deviation of the runs (n - 1); NaN of fewer than two
};

class Results {
 public:
  Results(const Plan& plan, std::vector<nlohmann::json> results);

  // Rows, then a row of each combination of choices with the means of all scenes, where there are
  // several: the mean over scenes of each seed that all have, and their spread. Among the rows
  // that have one baseline the best figures are bold; in brackets what the baseline is exceeded by.
  std::string markdown() const;
  // The same for what the trainings cost.
  std::string costs() const;
  std::string csv() const;       // means and spreads, a line a row
  std::string runs_csv() const;  // every figure of every run
  nlohmann::ordered_json json() const;

  // A figure of all rows as bars with their spread, scene by scene.
  std::vector<Plot> bars() const;
  // PSNR while training (metrics.jsonl), against steps and seconds; first seeds.
  std::vector<Plot> curves(const std::string& folder) const;

 private:
  struct Line {
    Row row;
    std::vector<Cell> cells;  // one a metric of `metrics_`
  };
  std::string markdown_of(const std::vector<Metric>& metrics, bool marks) const;
  std::vector<Line> lines_of(const std::vector<Metric>& metrics) const;

  const Plan& plan_;
  std::vector<nlohmann::json> results_;
  std::vector<Metric> metrics_;
};

// Error where no scene has the test views of a film at any of its steps.
void require_films(const Plan& plan);

// Pictures of the first seed of each row, as compare.png of its run, below each other:
// FOLDER/pictures/SCENE.png; and the films that are asked for, truth first:
// SCENE_VIEW_FIRST-LAST.png, where the scene has such views. Returns the files that were written.
std::vector<std::string> write_contact_sheets(const Plan& plan, const std::string& folder);

}  // namespace gflow::experiments
