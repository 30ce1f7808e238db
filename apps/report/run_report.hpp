// SPDX-License-Identifier: Apache-2.0
// The report of a run as one HTML file that needs no other and no script: what was trained on what,
// metrics, curves, views beside their truth, settings.
#pragma once
#include <string>
#include <vector>

#include "apps/report/log.hpp"
#include "apps/report/pictures.hpp"
#include "optim/eval/evaluation.hpp"
#include "optim/runs/run_folder.hpp"

namespace gflow::report {

// The images of a scene, in numbers.
struct SceneFacts {
  std::string name, layout;
  size_t images = 0, tracks = 0, cameras = 0;  // trained: images, cameras that took them, poses
  int steps = 0;                               // distinct times
  int width = 0, height = 0;                   // of the largest image, as trained [px]
};

// A view that the report shows.
struct ShownView {
  ViewMetrics metrics;
  Picture truth, rendered, error, flow, target;  // flow and target may be empty
};

// The evaluated views of one camera, still or moving.
struct CameraViews {
  std::string name;
  std::vector<size_t> views;  // indices into Evaluation::views, in order of time
};

struct RunReport {
  std::string title;           // of the page
  std::string run;             // name of the run folder
  std::string date, version;   // today; the program's
  std::string driver;          // of the device, empty if unknown
  std::string split = "test";  // of the evaluated views: test, train or val
  SceneFacts scene;
  TrainOptions config;
  RunFacts facts;
  Evaluation evaluation;
  std::vector<CameraViews> cameras;  // of the evaluated views
  std::vector<LogLine> log;
  std::vector<ShownView> views;
  double flow_length = 0;            // [px] of the rim of the flow's colour wheel
  std::vector<std::string> notices;  // of training and scene, one sentence each
};

// The whole document. The same report gives the same bytes.
std::string run_report_html(const RunReport& report);

}  // namespace gflow::report
