// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/choices.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace gflow::bench {
namespace {

std::vector<Choice> all_choices(int lanes) {
  std::vector<Choice> all{{"shipped", "shipped", {}}};
  const auto add = [&](const char* knob, const std::string& value) -> EngineSettings& {
    all.push_back({knob, fmt::format("{} {}", knob, value), {}});
    return all.back().settings;
  };
  for (const char* name : {"paper", "ot", "translate"})
    add("transport", name).transport = value_named<Transport>(name);
  for (const int k : {1, 4, 16, 20, 32, 64}) add("top_k", std::to_string(k)).top_k = k;
  add("stop", "exclude").stop = StopRule::exclude;
  for (const std::string t : {"1e-2", "1e-3", "1e-5", "1e-6"})
    add("pixels finished at", t).defines = {{"T_MIN", t + "f"}};
  // log2 of 1/64, 1/128, 1/512, 1/2048.
  for (const auto& [name, log2] :
       {std::pair{"1/64", "-6.f"}, {"1/128", "-7.f"}, {"1/512", "-9.f"}, {"1/2048", "-11.f"}})
    add("alpha >=", name).defines = {{"ALPHA_MIN_LOG2", log2}};
  add("boxes", "loose").skip.boxes = false;
  for (const std::string sigmas : {"3.0", "2.5", "2.0"})
    add("boxes", "of at most " + sigmas + " sigma").defines = {{"BOX_SIGMAS", sigmas + "f"}};
  add("cell masks", "off").skip.masks = false;
  add("saturated tiles", "walked on").skip.saturated = false;
  Skips& none = add("skips", "none").skip;
  Skips::fields(none, [](const char*, bool& on, const Help&) { on = false; });
  for (const int w : {1, 4, 8, 16})
    if (w != lanes) {
      all.push_back({"lanes", fmt::format("lanes {}", w), {}, w});
    }
  return all;
}

}  // namespace

std::vector<Choice> choices_of(int lanes, const std::vector<std::string>& knobs) {
  std::vector<Choice> all = all_choices(lanes);
  std::vector<std::string> known;
  for (const Choice& choice : all)
    if (!choice.shipped() && (known.empty() || known.back() != choice.knob))
      known.push_back(choice.knob);
  for (const std::string& knob : knobs)
    if (std::find(known.begin(), known.end(), knob) == known.end())
      throw Error(fmt::format("--knob {}: there is none, but {}", knob, fmt::join(known, ", ")));
  if (knobs.empty()) return all;
  const auto unwanted = [&](const Choice& choice) {
    return !choice.shipped() && std::find(knobs.begin(), knobs.end(), choice.knob) == knobs.end();
  };
  all.erase(std::remove_if(all.begin(), all.end(), unwanted), all.end());
  return all;
}

}  // namespace gflow::bench
