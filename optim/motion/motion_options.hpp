// SPDX-License-Identifier: Apache-2.0
// Motion model and static/dynamic split (settings motion.*).
#pragma once
#include <map>
#include <string>

#include "optim/motion/hexplane_options.hpp"
#include "optim/motion/models.hpp"
#include "runtime/base/option.hpp"

namespace gflow {

// motion.model: `automatic` (chosen by the scene), or a MotionModelKind plus one.
enum class MotionChoice { automatic };
constexpr MotionChoice choice_of(MotionModelKind kind) { return MotionChoice(int(kind) + 1); }
inline std::vector<const char*> names_of(MotionChoice) {
  std::vector<const char*> names = names_of(MotionModelKind{});
  names.insert(names.begin(), "auto");
  return names;
}

struct MotionOptions {
  MotionChoice model = MotionChoice::automatic;
  int trial_steps = 0;
  int keys = 0;
  bool key_scales = false;
  int bases = 8;
  int sh_degree = 2;
  int sh_interval = 1000;
  float cutoff = 0.05f;
  float duration = 8;
  float static_threshold = 0;
  int static_every = 500;
  float wake_threshold = 5;
  HexplaneOptions hexplane;               // a section of its own
  std::map<std::string, OwnNumbers> own;  // those of further models, by name; may lack some

  // Section of a model that declares numbers of its own.
  OwnNumbers& own_of(const MotionModel& model) {
    return own.try_emplace(model.name, model.own).first->second;
  }
  OwnNumbers own_of(const MotionModel& model) const {
    const auto found = own.find(model.name);
    return found == own.end() ? OwnNumbers(model.own) : found->second;
  }

  template <class Self, class Field>
  static void fields(Self& self, Field&& field) {
    field("model", self.model,
          "spacetime: curved paths and rotation; native4d: 4D Gaussians; keyframes: free paths "
          "through keys; bases: a few rigid motions shared by all; hexplane: one pose and a field "
          "that shifts it; nodes: such a field moves nodes, and Gaussians follow the nearest; "
          "auto: keyframes for one moving camera, nodes where one camera at a time sees the scene "
          "otherwise, else spacetime; or by trial_steps");
    field("trial_steps", self.trial_steps,
          "auto: choose the best on views held back in trainings of so many steps with spacetime, "
          "keyframes, hexplane and nodes; 0: by the kind of scene",
          at_least(0));
    field("keys", self.keys, "keyframes, bases: number of keys in time; 0: one per time step",
          between(0, 10000));
    field("key_scales", self.key_scales, "keyframes: scales have keys, too");
    field("bases", self.bases, "bases: number of rigid motions", between(1, 32));
    field("duration", self.duration,
          advanced("length of the video in model time [x scene extent]: a speed of 1 covers this "
                   "distance"),
          above(0));
    field("sh_degree", self.sh_degree, "highest degree of the spherical harmonics", between(0, 3));
    field("sh_interval", self.sh_interval,
          advanced("steps between two increases of the degree in use"), at_least(1));
    field("cutoff", self.cutoff, advanced("skip Gaussians with a lower temporal opacity"),
          between(0, 0.5f));
    field("static_threshold", self.static_threshold,
          "Gaussians that move and rotate less become static and lose their motion parameters "
          "[their own size]; 0: all stay dynamic",
          at_least(0));
    field("static_every", self.static_every,
          advanced("steps between two selections of static Gaussians"), at_least(1));
    field("wake_threshold", self.wake_threshold,
          advanced("a static Gaussian becomes dynamic when its accumulated gradient exceeds this "
                   "multiple of the expected noise; 0: only when density control duplicates it"),
          at_least(0));
  }
};

}  // namespace gflow
