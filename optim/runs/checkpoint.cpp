// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/checkpoint.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "optim/motion/parameters_state.hpp"
#include "optim/options/train_options.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/json_text.hpp"
#include "runtime/files/modest_json.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

constexpr int kFormat = 2;  // increases when the meaning of the arrays changes
constexpr const char* kFacts = "facts";
constexpr double kFarthest = 1e15;  // [scene units] beyond it a double has no fractions

OrderedJson json_of(const ModelShape& shape) {
  OrderedJson json{{"motion", name_of(shape.motion)}, {"sh_degree", shape.sh_degree}};
  MotionShape::fields(shape,
                      [&](const char* name, auto value, double, double) { json[name] = value; });
  json["origin"] = shape.origin;
  return json;
}

// A number above `lowest` and at most `highest`. Error that names it otherwise.
double number_in(const OrderedJson& json, const char* name, double lowest, double highest,
                 const std::string& path) {
  const OrderedJson& value = json.at(name);
  if (!value.is_number() || !(value.get<double>() > lowest && value.get<double>() <= highest))
    throw Error(fmt::format("{} is damaged: '{}' is {}", path, name, value.dump()));
  return value;
}

ModelShape shape_of(const OrderedJson& json, const std::string& path) {
  const auto names = names_of(MotionModelKind{});
  const auto name = std::find(names.begin(), names.end(), json.at("motion").get<std::string>());
  if (name == names.end())
    throw Error(fmt::format("{} has an unknown motion model, {}; known models: {}", path,
                            json.at("motion").dump(), fmt::join(names, ", ")));
  ModelShape shape;
  shape.motion = MotionModelKind(name - names.begin());
  shape.sh_degree = int(number_in(json, "sh_degree", -1, 3, path));
  MotionShape::fields(shape, [&](const char* field, auto& value, double lowest, double highest) {
    if (may_be_missing(field) && !json.contains(field)) return;
    value = std::decay_t<decltype(value)>(number_in(json, field, lowest, highest, path));
  });
  if (!json.contains("origin")) return shape;  // written by an older gflow
  json.at("origin").get_to(shape.origin);
  for (const double x : shape.origin)
    if (!(std::fabs(x) <= kFarthest))
      throw Error(fmt::format("{} is damaged: its origin is {}", path, json.at("origin").dump()));
  return shape;
}

OrderedJson json_of(const Checkpoint& checkpoint) {
  const CheckpointFacts& facts = checkpoint.facts;
  OrderedJson shapes = OrderedJson::object();
  for (const auto& [name, array] : checkpoint.arrays) shapes[name] = array.shape;
  OrderedJson json{{"format", kFormat},        {"step", facts.step},   {"seconds", facts.seconds},
                   {"config", facts.config},   {"scene", facts.scene}, {"device", facts.device},
                   {"program", facts.program}, {"arrays", shapes}};
  if (facts.shape) json["model"] = json_of(*facts.shape);
  return json;
}

// The JSON text among the arrays. Error if there is none of this format.
OrderedJson facts_json(const Arrays& arrays, const std::string& path) {
  const auto found = arrays.find(kFacts);
  const auto* text =
      found == arrays.end() ? nullptr : std::get_if<std::vector<uint8_t>>(&found->second.values);
  if (!text) throw Error(path + " is not a checkpoint: it has no byte array 'facts'");
  require_json_limits(text->data(), text->size(), path);
  const OrderedJson json = OrderedJson::parse(text->begin(), text->end());
  const OrderedJson& format = json.at("format");
  if (!format.is_number_integer())
    throw Error(fmt::format("{} is not a checkpoint: its format is {}", path, format.dump()));
  if (format != kFormat)
    throw Error(
        fmt::format("{} has checkpoint format {}, but this gflow reads format {}: continue with "
                    "the gflow that wrote it",
                    path, format.dump(), kFormat));
  return json;
}

// Error unless the arrays, except facts, are those that the facts list.
void require_arrays(const OrderedJson& json, const Arrays& arrays, const std::string& path) {
  const OrderedJson& shapes = json.at("arrays");
  for (const auto& [name, shape] : shapes.items())
    if (array_named(arrays, name, path).shape != shape.get<std::vector<size_t>>())
      throw Error(fmt::format(
          "{} is damaged: array '{}' has a different shape than when it was written", path, name));
  if (shapes.size() != arrays.size())
    throw Error(fmt::format("{} is damaged: it has {} arrays, but was written with {}", path,
                            arrays.size(), shapes.size()));
}

// The number in iteration_NUMBER.npz, or -1.
int step_of_name(const fs::path& path) {
  return path.extension() == ".npz" ? iteration_of_name(path.stem().string()) : -1;
}

CheckpointFacts facts_of(const OrderedJson& json, const std::string& path) {
  CheckpointFacts facts;
  const OrderedJson& step = json.at("step");
  const int named = step_of_name(path);
  if (!step.is_number_integer() || step < 0 || step > std::numeric_limits<int>::max() ||
      (named >= 0 && step != named))
    throw Error(fmt::format("{} is damaged: its step is {}", path, step.dump()));
  facts.step = step;
  facts.seconds = json.at("seconds");
  facts.config = json.at("config");
  try {
    TrainOptions readable;
    apply_text(readable, facts.config, "its settings");
  } catch (const Error& problem) {
    throw Error(fmt::format("{} is damaged: {}", path, problem.what()));
  }
  facts.scene = json.at("scene");
  facts.device = json.at("device");
  facts.program = json.at("program");
  if (json.contains("model")) facts.shape = shape_of(json.at("model"), path);
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
    const OrderedJson json = facts_json(checkpoint.arrays, path);
    checkpoint.arrays.erase(kFacts);
    require_arrays(json, checkpoint.arrays, path);
    checkpoint.facts = facts_of(json, path);
    const std::string unsound =
        non_finite_array(checkpoint.arrays, uint32_t(checkpoint.facts.step));
    if (!unsound.empty())
      throw Error(fmt::format(
          "cannot resume from {}: array '{}' contains values that are NaN, Inf or out of range",
          path, unsound));
  } catch (const OrderedJson::exception& problem) {
    throw Error(fmt::format("{} is not a checkpoint: {}", path, reason_of(problem)));
  }
  return checkpoint;
}

CheckpointFacts read_checkpoint_facts(const std::string& path) {
  try {
    return facts_of(facts_json(read_npz(path, {kFacts}), path), path);
  } catch (const OrderedJson::exception& problem) {
    throw Error(fmt::format("{} is not a checkpoint: {}", path, reason_of(problem)));
  }
}

std::string crc32_text(const void* bytes, size_t length) {
  return fmt::format("{:08x}", crc32_z(0, static_cast<const Bytef*>(bytes), length));
}

std::string device_stamp(const DeviceInfo& device) {
  return fmt::format("{}, driver {}, {} lanes", device.full_name(), device.driver, device.lanes);
}

int iteration_of_name(const std::string& name) {
  int iteration = -1;
  const bool numbered = std::sscanf(name.c_str(), "iteration_%d", &iteration) == 1;
  const bool is_it = numbered && iteration >= 0 && name == fmt::format("iteration_{}", iteration);
  return is_it ? iteration : -1;
}

// Checksum of the executable, so that any change of code, compiler or flags shows.
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
  std::error_code none;  // a training process may remove the folder meanwhile
  fs::directory_iterator entry(folder_, none), end;
  for (; !none && entry != end; entry.increment(none))
    if (const int step = step_of_name(entry->path()); step >= 0) steps.push_back(step);
  std::sort(steps.rbegin(), steps.rend());
  return steps;
}

void CheckpointFolder::write(const Checkpoint& checkpoint) const {
  std::error_code problem;
  fs::create_directories(folder_, problem);
  if (problem) throw Error(fmt::format("cannot create {}: {}", folder_, problem.message()));
  const int step = checkpoint.facts.step;
  try {
    write_checkpoint(path(step), checkpoint);
  } catch (const DiskFull& full) {
    if (!make_room(full)) throw;
    write_checkpoint(path(step), checkpoint);
  }
  bool kept_one = false;  // later ones are unreadable
  for (const int other : steps()) {
    if (other == step) continue;
    if (other < step && !kept_one)
      kept_one = true;
    else
      fs::remove(path(other), problem);
  }
}

bool CheckpointFolder::make_room(const DiskFull& problem) const {
  const auto can_be_read = [&](int step) {
    try {
      read_checkpoint(path(step));
      return true;
    } catch (const std::exception&) {  // or memory does not suffice to read it
      return false;
    }
  };
  std::vector<int> older = steps();
  if (older.size() < 2) return false;
  const auto kept = std::find_if(older.begin(), older.end(), can_be_read);
  if (kept == older.end()) return false;
  const int last = *kept;
  older.erase(kept);
  std::vector<int> removed;
  std::error_code failed;
  for (const int step : older)
    if (fs::remove(path(step), failed)) removed.push_back(step);
  if (removed.empty()) return false;
  warn(fmt::format("{}; deleted older checkpoints to free space (step {}), kept that of step {}",
                   problem.what(), fmt::join(removed, ", "), last));
  return true;
}

std::optional<CheckpointFolder::Found> CheckpointFolder::latest() const {
  std::string reason;
  for (const int step : steps()) {
    if (!reason.empty()) warn(reason + "; trying the previous checkpoint");
    try {
      return Found{path(step), read_checkpoint(path(step))};
    } catch (const Error& problem) {
      reason = problem.what();
    }
  }
  if (reason.empty()) return std::nullopt;
  throw Error(fmt::format(
      "no usable checkpoint in {}: {}; to start over, use --overwrite instead of --resume", folder_,
      reason));
}

}  // namespace gflow
