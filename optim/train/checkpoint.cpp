// SPDX-License-Identifier: Apache-2.0
#include "optim/train/checkpoint.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "optim/io/json_text.hpp"
#include "optim/motion/parameters_state.hpp"
#include "optim/train/warning.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kFormat = 1;  // rises when what the arrays mean changes
constexpr const char* kFacts = "facts";

Json json_of(const ModelShape& shape) {
  Json json{{"motion", names_of(shape.motion)[size_t(shape.motion)]},
            {"sh_degree", shape.sh_degree}};
  MotionShape::fields(shape, [&](const char* name, auto value, double) { json[name] = value; });
  json["origin"] = shape.origin;
  return json;
}

ModelShape shape_of(const Json& json) {
  const auto names = names_of(MotionModelKind{});
  const auto name = std::find(names.begin(), names.end(), json.at("motion").get<std::string>());
  if (name == names.end()) throw Error("there is no motion model " + json.at("motion").dump());
  ModelShape shape;
  shape.motion = MotionModelKind(name - names.begin());
  shape.sh_degree = json.at("sh_degree");
  MotionShape::fields(
      shape, [&](const char* field, auto& value, double) { json.at(field).get_to(value); });
  if (json.contains("origin")) json.at("origin").get_to(shape.origin);  // older ones have none
  return shape;
}

Json json_of(const Checkpoint& checkpoint) {
  const CheckpointFacts& facts = checkpoint.facts;
  Json shapes = Json::object();
  for (const auto& [name, array] : checkpoint.arrays) shapes[name] = array.shape;
  Json json{{"format", kFormat},        {"step", facts.step},   {"seconds", facts.seconds},
            {"config", facts.config},   {"scene", facts.scene}, {"device", facts.device},
            {"program", facts.program}, {"arrays", shapes}};
  if (facts.shape) json["model"] = json_of(*facts.shape);
  return json;
}

// The JSON text among the arrays. Error when there is none of this format.
Json facts_json(const Arrays& arrays, const std::string& path) {
  const auto found = arrays.find(kFacts);
  const auto* text =
      found == arrays.end() ? nullptr : std::get_if<std::vector<uint8_t>>(&found->second.values);
  if (!text) throw Error(path + " is no checkpoint: it does not say what it holds ('facts')");
  const Json json = Json::parse(text->begin(), text->end());
  const int format = json.at("format");
  if (format != kFormat)
    throw Error(
        fmt::format("{} has checkpoint format {} and this gflow reads format {}: go on with the "
                    "gflow that wrote it, or train anew without --resume",
                    path, format, kFormat));
  return json;
}

// Error unless the arrays, facts aside, are those that the facts list.
void require_arrays(const Json& json, const Arrays& arrays, const std::string& path) {
  const Json& shapes = json.at("arrays");
  for (const auto& [name, shape] : shapes.items())
    if (array_named(arrays, name, path).shape != shape.get<std::vector<size_t>>())
      throw Error(fmt::format("{} is damaged: array '{}' has not the shape it was written with",
                              path, name));
  if (shapes.size() != arrays.size())
    throw Error(fmt::format("{} is damaged: it has {} arrays and was written with {}", path,
                            arrays.size(), shapes.size()));
}

CheckpointFacts facts_of(const Json& json, const std::string& path) {
  CheckpointFacts facts;
  const Json& step = json.at("step");
  if (!step.is_number_integer() || step < 0 || step > std::numeric_limits<int>::max())
    throw Error(fmt::format("{} is damaged: it says that it is of step {}", path, step.dump()));
  facts.step = step;
  facts.seconds = json.at("seconds");
  facts.config = json.at("config");
  facts.scene = json.at("scene");
  facts.device = json.at("device");
  facts.program = json.at("program");
  if (json.contains("model")) facts.shape = shape_of(json.at("model"));
  return facts;
}

}  // namespace

void write_checkpoint(const std::string& path, const Checkpoint& checkpoint) {
  const std::string text = json_text(json_of(checkpoint));
  Arrays arrays = checkpoint.arrays;
  arrays[kFacts] = {{text.size()}, std::vector<uint8_t>(text.begin(), text.end())};
  write_npz(path, arrays, Packing::stored);
}

Checkpoint read_checkpoint(const std::string& path) {
  Checkpoint checkpoint;
  checkpoint.arrays = read_npz(path);
  try {
    const Json json = facts_json(checkpoint.arrays, path);
    checkpoint.arrays.erase(kFacts);
    require_arrays(json, checkpoint.arrays, path);
    checkpoint.facts = facts_of(json, path);
    const std::string unsound = unsound_array(checkpoint.arrays);
    if (!unsound.empty())
      throw Error(fmt::format(
          "{} cannot be gone on from: in array '{}' are values that no training leaves, not finite "
          "or a second moment below 0",
          path, unsound));
  } catch (const Json::exception& problem) {
    throw Error(fmt::format("{} is no checkpoint: {}", path, problem.what()));
  }
  return checkpoint;
}

CheckpointFacts read_checkpoint_facts(const std::string& path) {
  try {
    return facts_of(facts_json(read_npz(path, {kFacts}), path), path);
  } catch (const Json::exception& problem) {
    throw Error(fmt::format("{} is no checkpoint: {}", path, problem.what()));
  }
}

std::string crc32_text(const void* bytes, size_t length) {
  return fmt::format("{:08x}", crc32_z(0, static_cast<const Bytef*>(bytes), length));
}

std::string device_stamp(const DeviceInfo& device) {
  return fmt::format("{}, driver {}, {} lanes", device.full_name(), device.driver, device.lanes);
}

// The program itself: whatever was changed, compiler and flags included, it shows here.
std::string program_stamp() {
  try {
    const Bytes program = read_file("/proc/self/exe");
    return crc32_text(program.data(), program.size());
  } catch (const Error&) {
    return "unknown";
  }
}

std::string CheckpointFolder::path(int step) const {
  return fmt::format("{}/iteration_{}.npz", folder_, step);
}

std::vector<int> CheckpointFolder::steps() const {
  std::vector<int> steps;
  std::error_code none;  // a training may remove the folder meanwhile
  for (const auto& entry : fs::directory_iterator(folder_, none)) {
    int step = -1;
    const std::string name = entry.path().filename().string();
    if (std::sscanf(name.c_str(), "iteration_%d", &step) == 1 && entry.path() == path(step))
      steps.push_back(step);
  }
  std::sort(steps.rbegin(), steps.rend());
  return steps;
}

void CheckpointFolder::write(const Checkpoint& checkpoint) const {
  std::error_code problem;
  fs::create_directories(folder_, problem);
  if (problem) throw Error(fmt::format("cannot make {}: {}", folder_, problem.message()));
  const int step = checkpoint.facts.step;
  write_checkpoint(path(step), checkpoint);
  bool kept_one = false;  // later ones are those that could not be read
  for (const int other : steps()) {
    if (other == step) continue;
    if (other < step && !kept_one)
      kept_one = true;
    else
      fs::remove(path(other), problem);
  }
}

std::optional<CheckpointFolder::Found> CheckpointFolder::latest() const {
  std::string reason;
  for (const int step : steps()) {
    if (!reason.empty()) warn(reason + "; the checkpoint before it is tried");
    try {
      Found found{path(step), read_checkpoint(path(step))};
      if (found.checkpoint.facts.step == step) return found;
      reason = fmt::format("{} is damaged: it says that it is of step {}", found.path,
                           found.checkpoint.facts.step);
    } catch (const Error& problem) {
      reason = problem.what();
    }
  }
  if (reason.empty()) return std::nullopt;
  throw Error(
      fmt::format("no checkpoint in {} can be used: {}; without --resume, training starts "
                  "anew and replaces them",
                  folder_, reason));
}

void CheckpointFolder::clear() const { fs::remove_all(folder_); }

}  // namespace gflow
