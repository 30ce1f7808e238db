// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/view_model.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

using Json = nlohmann::ordered_json;
using Shape = std::vector<size_t>;

constexpr float kColorSteps = 1024;

// Collects arrays and their entries of the header.
class ArrayWriter {
 public:
  explicit ArrayWriter(ViewPrecision precision) : precision_(precision) {}

  void put(const std::string& name, const Shape& shape, const std::vector<float>& values) {
    append(name, shape, "float32", values);
  }
  // Colours: multiples of 1/1024, because zero bits compress.
  void put_color(const std::string& name, const Shape& shape, const std::vector<float>& values) {
    if (precision_ == ViewPrecision::full) return put(name, shape, values);
    std::vector<uint16_t> halves;
    halves.reserve(values.size());
    for (const float x : values)
      halves.push_back(
          Eigen::half(std::clamp(std::round(x * kColorSteps) / kColorSteps, -65504.f, 65504.f)).x);
    append(name, shape, "float16", halves);
  }
  // Poses and keys, [times, N, columns]: whole multiples of `step`, or if their range exceeds 16
  // bits, of a larger one, as differences over time, which compress to a third; those have their
  // sign in the lowest bit, so that the upper byte of small ones is 0.
  void put_pose(const std::string& name, const Shape& shape, const std::vector<float>& values,
                double step) {
    const bool finite =
        std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); });
    if (precision_ == ViewPrecision::full || values.empty() || !finite)
      return put(name, shape, values);
    const size_t width = shape.back(), row = values.size() / shape[0];
    std::vector<double> least(width, INFINITY), most(width, -INFINITY), scale(width);
    for (size_t i = 0; i < values.size(); ++i) {
      least[i % width] = std::min(least[i % width], double(values[i]));
      most[i % width] = std::max(most[i % width], double(values[i]));
    }
    for (size_t c = 0; c < width; ++c) scale[c] = std::max((most[c] - least[c]) / 65535, step);
    std::vector<uint16_t> whole;
    whole.reserve(values.size());
    for (size_t i = 0; i < values.size(); ++i)
      whole.push_back(uint16_t(std::lround((values[i] - least[i % width]) / scale[i % width])));
    for (size_t i = whole.size(); i-- > row;) {
      const int16_t change = int16_t(whole[i] - whole[i - row]);
      whole[i] = uint16_t(2 * change ^ (change < 0 ? -1 : 0));
    }
    append(name, shape, "uint16", whole);
    entries_[name]["scale"] = scale;
    entries_[name]["shift"] = least;
    entries_[name]["differences"] = true;
  }

  const Json& entries() const { return entries_; }
  const std::string& bytes() const { return bytes_; }

 private:
  template <class Value>
  void append(const std::string& name, const Shape& shape, const char* type,
              const std::vector<Value>& values) {
    entries_[name] = {{"offset", bytes_.size()}, {"shape", shape}, {"type", type}};
    const char* from = reinterpret_cast<const char*>(values.data());
    const size_t size = values.size() * sizeof(Value);
    if (precision_ == ViewPrecision::full) {
      bytes_.append(from, size);
    } else {  // first bytes, second bytes, ...: compresses better
      entries_[name]["planes"] = true;
      for (size_t k = 0; k < sizeof(Value); ++k)
        for (size_t i = k; i < size; i += sizeof(Value)) bytes_ += from[i];
    }
    bytes_.resize((bytes_.size() + 7) / 8 * 8);
  }

  ViewPrecision precision_;
  Json entries_ = Json::object();
  std::string bytes_;
};

void put_group(ArrayWriter& arrays, const HostModel& model, const std::string& name) {
  const std::vector<float>& values = model.groups.at(name);
  const Shape shape{model.count, model.count ? values.size() / model.count : 0};
  const bool color = name == "sh0" || name == "sh_rest";
  if (color)
    arrays.put_color(name, shape, values);
  else
    arrays.put(name, shape, values);
}

// Columns first to first + width - 1 of log_scales [N, 4].
std::vector<float> spatial_scales(const HostModel& model) {
  std::vector<float> scales;
  scales.reserve(3 * model.count);
  const std::vector<float>& log_scales = model.groups.at("log_scales");
  for (size_t i = 0; i < model.count; ++i)
    scales.insert(scales.end(), &log_scales[4 * i], &log_scales[4 * i] + 3);
  return scales;
}

// Median of the longest scales of dynamic Gaussians [scene units]; > 0.
double usual_size(const HostModel& model) {
  std::vector<double> sizes;
  for (size_t i = 0; i < model.num_moving(); ++i) sizes.push_back(longest_scale(model, i));
  if (sizes.empty()) return 1;
  std::nth_element(sizes.begin(), sizes.begin() + long(sizes.size() / 2), sizes.end());
  return std::max(sizes[sizes.size() / 2], 1e-30);
}

// Steps of exported poses: what moves the surface of a usual Gaussian by 1/64 of its size. Keys
// have noise of training, which they keep with fewer digits.
constexpr double kStep = 1.0 / 32, kQuatStep = kStep / 16, kLogScaleStep = kStep / 2;
constexpr double kKeyStep = 1.0 / 16, kTurnStep = kKeyStep / 4;

// The rows [keys, N, width] of dynamic Gaussians: [keys, M, width], rounded.
void put_keys(ArrayWriter& arrays, const HostModel& model, const std::string& name, size_t width) {
  const size_t n = model.count, m = model.num_moving(), keys = size_t(model.shape.keys);
  const std::vector<float>& all = model.groups.at(name);
  std::vector<float> values;
  values.reserve(keys * m * width);
  for (size_t k = 0; k < keys; ++k) {
    const auto first = all.begin() + long(k * n * width);
    values.insert(values.end(), first, first + long(m * width));
  }
  const double step = name == "key_shifts"  ? kKeyStep * usual_size(model)
                      : name == "key_turns" ? kTurnStep
                                            : kLogScaleStep;
  arrays.put_pose(name, {keys, m, width}, values, step);
}

void put_poses(ArrayWriter& arrays, const HostModel& model, const BakedPoses& poses) {
  const size_t steps = poses.times.size(), m = poses.moving;
  arrays.put_pose("pose_means", {steps, m, 3}, poses.means, kStep * usual_size(model));
  arrays.put_pose("pose_quats", {steps, m, 4}, poses.quats, kQuatStep);
  if (!poses.log_scales.empty())
    arrays.put_pose("pose_log_scales", {steps, m, 3}, poses.log_scales, kLogScaleStep);
  if (!poses.opacities.empty())
    arrays.put_pose("pose_opacities", {steps, model.count}, poses.opacities, kStep / 16);
}

// A keyframes model whose quats have length 1, so that one step suits all key_turns; the same
// model.
HostModel with_unit_quats(HostModel model) {
  std::vector<float>&quats = model.groups.at("quats"), &turns = model.groups.at("key_turns");
  for (size_t i = 0; i < model.count; ++i) {
    Eigen::Map<Eigen::Vector4f> quat(&quats[4 * i]);
    const float norm = quat.norm();
    // That of a rounded model is nearly 1, and its zero bits are to stay.
    if (!(norm > 1e-3f && norm < 1e3f) || std::fabs(norm - 1) < 0.01f) continue;
    quat /= norm;
    for (size_t at = 4 * i; at < turns.size(); at += 4 * model.count)
      Eigen::Map<Eigen::Vector4f>(&turns[at]) /= norm;
  }
  return model;
}

// Name of the motion, for the page, and the arrays.
const char* put_arrays(ArrayWriter& arrays, const HostModel& model, const BakedPoses* poses) {
  put_group(arrays, model, "means");
  put_group(arrays, model, "quats");
  put_group(arrays, model, "logit_opacities");
  put_group(arrays, model, "sh0");
  if (model.shape.sh_degree > 0) put_group(arrays, model, "sh_rest");
  if (!poses && is_static_model(model)) {
    arrays.put("log_scales", {model.count, 3}, spatial_scales(model));
    return "static";
  }
  put_group(arrays, model, "means_t");
  put_group(arrays, model, "log_scales");
  if (poses) {
    put_poses(arrays, model, *poses);
    return "poses";
  }
  for (const MotionColumns& columns : motion_columns(model.shape))
    put_group(arrays, model, columns.group);
  for (const TableSpec& table : motion_tables(model.shape))
    for (const GroupSpec& group : table.groups) put_keys(arrays, model, group.name, group.width);
  return name_of(model.shape.motion);
}

}  // namespace

std::string view_model_bytes(const HostModel& given, const BakedPoses* poses,
                             const ViewFacts& facts, ViewPrecision precision) {
  const bool rounds_keys = precision == ViewPrecision::half && !poses &&
                           given.shape.motion == MotionModelKind::keyframes;
  const HostModel unit = rounds_keys ? with_unit_quats(given) : HostModel();
  const HostModel& model = rounds_keys ? unit : given;
  if (!poses && needs_poses(model))
    throw Error("a viewer needs poses of a " + std::string(name_of(model.shape.motion)) + " model");
  ArrayWriter arrays(precision);
  Json header{{"motion", put_arrays(arrays, model, poses)},
              {"model", name_of(model.shape.motion)},
              {"count", model.count},
              {"moving", model.num_moving()},
              {"sh_degree", model.shape.sh_degree}};
  header["duration"] = model.shape.duration;
  header["cutoff"] = model.shape.cutoff;
  if (model.shape.motion == MotionModelKind::keyframes && !poses) {
    header["keys"] = model.shape.keys;
    header["key_scales"] = model.shape.key_scales;
  }
  header["steps"] = poses && facts.steps == 0 ? poses->times.size() : facts.steps;
  if (poses) {
    header["times"] = poses->times;
    header["life"] = poses->opacities.empty();
  }
  header["fps"] = facts.fps > 0 ? Json(facts.fps) : Json();
  header["near"] = facts.near;
  header["background"] = facts.background;
  header["up"] = facts.up;
  header["stop"] = name_of(facts.stop);
  header["transport"] = name_of(facts.transport);
  header["origin"] = model.shape.origin;
  header["extent"] = facts.extent;
  header["arrays"] = arrays.entries();
  std::string text = json_text(header);
  text.resize((12 + text.size() + 7) / 8 * 8 - 12, ' ');
  const uint32_t length = uint32_t(text.size());
  char bytes[4];
  for (int k = 0; k < 4; ++k) bytes[k] = char(length >> (8 * k));
  return "GFLOWVM1" + std::string(bytes, 4) + text + arrays.bytes();
}

double extent_of(const HostModel& model) {
  if (model.count == 0) return 1;
  const std::vector<float>& means = model.groups.at("means");
  double squares = 0;
  for (size_t k = 0; k < 3; ++k) {
    std::vector<float> column;
    for (size_t i = 0; i < model.count; ++i) column.push_back(means[3 * i + k]);
    std::sort(column.begin(), column.end());
    const size_t cut = model.count / 50;
    const double side = double(column[model.count - 1 - cut]) - column[cut];
    squares += side * side;
  }
  return std::max(std::sqrt(squares) / 2, 1e-6);
}

}  // namespace gflow
