// SPDX-License-Identifier: Apache-2.0
// Every setting of a training: the options of all rooms, section by section, as config.toml has
// them.
#pragma once
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "optim/density/density_options.hpp"
#include "optim/engine/settings.hpp"
#include "optim/eval/metrics_options.hpp"
#include "optim/flow/flow_options.hpp"
#include "optim/guidance/guidance_options.hpp"
#include "optim/init/init_options.hpp"
#include "optim/loss/loss_options.hpp"
#include "optim/model/view_options.hpp"
#include "optim/motion/hexplane_options.hpp"
#include "optim/motion/motion_options.hpp"
#include "optim/options/training_options.hpp"
#include "optim/scene/scene_options.hpp"

namespace gflow {

struct TrainOptions {
  SceneOptions scene;
  ScheduleOptions train;
  MotionOptions motion;
  HexplaneOptions hexplane;
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
  // Of the engine's kernels, in place of theirs; no setting: `gflow bench pareto` tries them.
  std::vector<std::pair<std::string, std::string>> defines;

  // Calls section(name, part, help) for each section of the file.
  template <class Self, class Section>
  static void sections(Self& self, Section&& section) {
    section("scene", self.scene, "what is read");
    section("train", self.train, "how long, on what");
    section("motion", self.motion, "the Gaussians in time");
    section("hexplane", self.hexplane, "the field of motion.model = hexplane");
    section("init", self.init, "the first Gaussians");
    section("loss", self.loss, "pictures, and motion among neighbours");
    section("flow", self.flow, "optical flow");
    section("guidance", self.guidance, "views nobody filmed");
    section("lr", self.lr, "learning rates");
    section("adam", self.adam, "the optimiser");
    section("density", self.density, "how many Gaussians, where");
    section("render", self.render, "the image");
    section("metrics", self.metrics, "networks that judge the result; free to change");
    section("skip", self.skip,
            "work that is left out (to measure what it saves: gflow bench skip)");
  }
};
// What the engine needs to know.
EngineSettings engine_settings(const TrainOptions& config);

// The functions below throw Error: an unknown setting is named with the nearest known one, a wrong
// type or value with what is allowed, and each message starts with the file and line or the option
// it comes from.

// Changes the settings that a TOML file gives.
void apply_file(TrainOptions& config, const std::string& path);
// The same for TOML text, called `name` in errors.
void apply_text(TrainOptions& config, const std::string& text, const std::string& name);
// Changes one setting: "section.key=value". Text needs no quotes.
void apply_setting(TrainOptions& config, const std::string& assignment);
// Checks every value against its range; needed after members were set by hand.
void check(const TrainOptions& config);
// The whole configuration as TOML with a comment a line; reading it back gives the same values.
std::string to_toml(const TrainOptions& config);
// One setting in words: its value as TOML, what it means with its unit, and what it may be ("": any
// text).
struct SettingInWords {
  std::string name, value, meaning, allowed;  // name: "section.key"
  bool advanced = false;
};
// All, in the order of the file.
std::vector<SettingInWords> settings_in_words(const TrainOptions& config);
// Every setting as "section.key" and its value as TOML.
std::map<std::string, std::string> setting_values(const TrainOptions& config);

}  // namespace gflow
