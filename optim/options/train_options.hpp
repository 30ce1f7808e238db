// SPDX-License-Identifier: Apache-2.0
// All settings of a training run: the options of all rooms by section, as in config.toml.
#pragma once
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "optim/cameras/camera_options.hpp"
#include "optim/density/density_options.hpp"
#include "optim/engine/settings.hpp"
#include "optim/eval/metrics_options.hpp"
#include "optim/flow/flow_options.hpp"
#include "optim/guidance/guidance_options.hpp"
#include "optim/init/init_options.hpp"
#include "optim/loss/loss_options.hpp"
#include "optim/model/view_options.hpp"
#include "optim/motion/motion_options.hpp"
#include "optim/options/schedule_options.hpp"
#include "optim/scene/scene_options.hpp"

namespace gflow {

struct TrainOptions {
  SceneOptions scene;
  CameraOptions cameras;
  ScheduleOptions train;
  MotionOptions motion;
  InitOptions init;
  LossOptions loss;
  FlowOptions flow;
  GuidanceOptions guidance;
  LearningRateOptions lr;
  AdamOptions adam;
  DensityOptions density;
  ViewOptions render;
  MetricsOptions metrics;
  Skips skip;
  // Overrides of the engine's kernel defines. Not a setting; `gflow bench pareto` uses it.
  std::vector<std::pair<std::string, std::string>> defines;

  // Calls section(name, part, help) for each section of the file.
  template <class Self, class Section>
  static void sections(Self& self, Section&& section) {
    section("scene", self.scene, "scene and how to read it");
    section("cameras", self.cameras, "correction of the cameras");
    section("train", self.train, "schedule");
    section("motion", self.motion, "motion of the Gaussians");
    section("hexplane", self.motion.hexplane, "field of motion.model = hexplane");
    for (const MotionModel* model : motion_models()) {
      auto&& own = self.motion.own_of(*model);
      if (!own.empty()) section(model->name, own, "numbers of that motion model");
    }
    section("init", self.init, "initial Gaussians");
    section("loss", self.loss, "image loss and regularisers of motion");
    section("flow", self.flow, "optical flow");
    section("guidance", self.guidance, "supervision of novel views");
    section("lr", self.lr, "learning rates");
    section("adam", self.adam, "optimiser");
    section("density", self.density, "number and placement of Gaussians");
    section("render", self.render, "rendering");
    section("metrics", self.metrics, "networks for evaluation; may be changed at any time");
    section("skip", self.skip, "work to skip (savings: gflow bench skip)");
  }
};
// Engine settings of a configuration.
EngineSettings engine_settings(const TrainOptions& config);

// The functions below throw Error. It names an unknown setting with the nearest known one, and for
// a wrong type or value what is allowed. Each message starts with the file and line or the option
// that it comes from.

// Applies the settings of a TOML file.
void apply_file(TrainOptions& config, const std::string& path);
// The same for TOML text, called `name` in errors.
void apply_text(TrainOptions& config, const std::string& text, const std::string& name);
// Applies one setting: "section.key=value". Text needs no quotes.
void apply_setting(TrainOptions& config, const std::string& assignment);
// Checks every value against its range; call it after setting members directly.
void check(const TrainOptions& config);
// The whole configuration as TOML with one comment per line; reading it back gives the same values.
std::string to_toml(const TrainOptions& config);
// Documentation of one setting: value as TOML, meaning with unit, and allowed values ("": any
// text).
struct SettingInWords {
  std::string name, value, meaning, allowed;  // name: "section.key"
  bool advanced = false;
};
// All settings, in the order of the file.
std::vector<SettingInWords> settings_in_words(const TrainOptions& config);
// Every setting as "section.key" and its value as TOML.
std::map<std::string, std::string> setting_values(const TrainOptions& config);

}  // namespace gflow
