// SPDX-License-Identifier: Apache-2.0
// The report of an experiment as one HTML file: its table, bars, curves, costs and contact sheets.
#pragma once
#include <string>
#include <vector>

#include "apps/experiments/table.hpp"
#include "apps/report/chart.hpp"
#include "apps/report/pictures.hpp"

namespace gflow::report {

// PSNR of the training images over the steps, of the rows of one scene.
struct SceneCurves {
  std::string scene;
  std::vector<Series> series;
};
// A contact sheet.
struct Sheet {
  std::string name;
  Picture picture;
};

struct ExperimentReport {
  std::string title, date, version, summary;
  std::vector<std::string> axes;
  size_t scenes = 0, runs = 0;
  std::string baseline;  // what differences are to; empty: no differences
  experiments::Table table, costs;
  std::vector<BarChart> bars;
  std::vector<SceneCurves> curves;
  std::vector<Sheet> sheets;
};

// The whole document. The same report gives the same bytes.
std::string experiment_report_html(const ExperimentReport& report);

// Writes report.html into the folder of an experiment. sheets: paths of the contact sheets.
// version: the program's. Returns the path, or "" after a warning.
std::string write_experiment_report(const experiments::Plan& plan,
                                    const experiments::Results& results, const std::string& folder,
                                    const std::vector<std::string>& sheets,
                                    const std::string& version);

}  // namespace gflow::report
