// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/process.hpp"

#include <fmt/format.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "runtime/files/modest_json.hpp"

namespace gflow {
namespace {

using Json = nlohmann::json;
using Milliseconds = std::chrono::milliseconds;

// An array in the shared memory.
struct Place {
  size_t offset = 0;  // [bytes]
  std::vector<size_t> shape;

  size_t count() const {
    size_t n = 1;
    for (const size_t size : shape) n *= size;
    return n;
  }
  Json json() const { return {{"offset", offset}, {"shape", shape}}; }
};

// Allocates the shared memory from its beginning; arrays are aligned to 64 bytes.
class Layout {
 public:
  Place place(std::vector<size_t> shape, size_t bytes_each = 4) {
    Place place{size_, std::move(shape)};
    size_ += (place.count() * bytes_each + 63) / 64 * 64;
    return place;
  }
  size_t size() const { return size_; }

 private:
  size_t size_ = 0;
};

struct ViewPlaces {
  Place rgb, flow, gradient, target_flow, confidence;
};

Json json_of(const Camera& camera) {
  const auto& m = camera.viewmat;
  Json rows = Json::array();
  for (int r = 0; r < 4; ++r) rows.push_back({m(r, 0), m(r, 1), m(r, 2), m(r, 3)});
  return {{"name", camera.name},
          {"width", camera.width},
          {"height", camera.height},
          {"K", {{camera.fx, 0, camera.cx}, {0, camera.fy, camera.cy}, {0, 0, 1}}},
          {"viewmat", rows}};
}

std::vector<size_t> planes(size_t count, const Camera& camera) {
  return {count, size_t(camera.height), size_t(camera.width)};
}

template <class T>
void put(const SharedMemory& memory, const Place& place, const std::vector<T>& values) {
  std::memcpy(memory.data() + place.offset, values.data(), values.size() * sizeof(T));
}

template <class T>
std::vector<T> taken(const SharedMemory& memory, const Place& place) {
  std::vector<T> values(place.count());
  std::memcpy(values.data(), memory.data() + place.offset, values.size() * sizeof(T));
  return values;
}

// Parses a line of the program. GuidanceFailed if it is not a JSON object or contains an error.
Json parsed(const std::string& line, const std::string& provider) {
  const Json answer = parse_json_within_limits(line);
  if (!answer.is_object()) {
    constexpr size_t shown = 60;
    const std::string start = line.size() > shown ? line.substr(0, shown) + "..." : line;
    throw GuidanceFailed(
        fmt::format("{} answered '{}', which is not a JSON object; standard output is reserved for "
                    "answers, log to standard error",
                    provider, Json(start).dump(-1, ' ', true, Json::error_handler_t::replace)));
  }
  if (answer.contains("error")) {
    const Json& reason = answer["error"];
    const std::string said = reason.is_string() ? reason.get<std::string>() : reason.dump();
    constexpr size_t most = 500;  // bytes of it that are shown
    throw GuidanceFailed(said.empty()
                             ? fmt::format("{} reported an error without a message", provider)
                             : fmt::format("{} reported an error: {}{}", provider,
                                           said.substr(0, most), said.size() > most ? "..." : ""));
  }
  return answer;
}

// Whether the program wrote this array. It answers with the shape, or with null or nothing for
// none. GuidanceFailed for another shape.
bool wrote(const Json& view, const char* what, const Place& place, const std::string& provider) {
  const auto shape = view.find(what);
  if (shape == view.end() || shape->is_null()) return false;
  if (*shape == Json(place.shape)) return true;
  if (place.shape.empty())
    throw GuidanceFailed(
        fmt::format("{} answered with a {} that was not requested", provider, what));
  throw GuidanceFailed(fmt::format("{} answered with a {} of shape {}, expected {}", provider, what,
                                   shape->dump(), Json(place.shape).dump()));
}

float weight_in(const Json& view, const char* what, const std::string& provider) {
  const auto weight = view.find(what);
  if (weight == view.end()) return 1;
  if (!weight->is_number())
    throw GuidanceFailed(fmt::format("{} answered with a {} of {}, expected a number", provider,
                                     what, weight->dump()));
  return weight->get<float>();
}

GuidanceAnswer answer_of(const Json& view, const ViewPlaces& places, const SharedMemory& memory,
                         const std::string& provider) {
  GuidanceAnswer answer;
  answer.weight = weight_in(view, "weight", provider);
  answer.flow_weight = weight_in(view, "flow_weight", provider);
  if (wrote(view, "gradient", places.gradient, provider))
    answer.gradient = taken<float>(memory, places.gradient);
  if (wrote(view, "flow", places.target_flow, provider))
    answer.flow = taken<float>(memory, places.target_flow);
  if (wrote(view, "confidence", places.confidence, provider))
    answer.confidence = taken<uint8_t>(memory, places.confidence);
  return answer;
}

}  // namespace

ProcessGuidance::ProcessGuidance(const std::string& command, double time_out, const SdsRule& rule)
    : command_(command),
      time_out_(Milliseconds(int64_t(1000 * time_out))),
      rule_(rule),
      child_(command) {
  child_.send(Json{{"protocol", "gflow-guidance"}, {"version", version}}.dump(), time_out_);
  const Json greeting = parsed(child_.receive(time_out_), name());
  const bool echo = greeting.contains("protocol");  // ours: it does not know the protocol
  if (echo || !greeting.contains("version") || greeting["version"] != version)
    throw GuidanceFailed(fmt::format(
        "{} greeted with {}, expected {{\"version\": {}}}: it is not compatible with this gflow",
        name(), greeting.dump(-1, ' ', true, Json::error_handler_t::replace), version));
}

std::string ProcessGuidance::name() const {
  return fmt::format("the guidance program `{}`", command_);
}

std::vector<GuidanceAnswer> ProcessGuidance::guide(const GuidanceRequest& request) {
  Layout layout;
  const Place reference = layout.place(planes(3, request.reference.camera));
  std::vector<ViewPlaces> places;
  for (const GuidanceView& view : request.views) {
    ViewPlaces p;
    p.rgb = layout.place(planes(3, view.camera));
    p.gradient = layout.place(planes(3, view.camera));
    if (request.wants_flow) {
      p.flow = layout.place(planes(2, view.camera));
      p.target_flow = layout.place(planes(2, view.camera));
      p.confidence =
          layout.place({size_t(view.camera.height), size_t(view.camera.width)}, sizeof(uint8_t));
    }
    places.push_back(std::move(p));
  }
  if (!memory_ || memory_->size() < layout.size())
    memory_ = std::make_unique<SharedMemory>(layout.size());
  memory_->require_whole();

  Json line{
      {"type", "guide"},
      {"memory", {{"name", memory_->name()}, {"bytes", memory_->size()}}},
      {"step", request.step},
      {"steps", request.steps},
      {"progress", request.progress},
      {"seed", request.seed},
      {"time", request.time},
      {"frame", request.frame},
      {"background", request.background},
      {"next_time", request.wants_flow ? Json(request.next_time) : Json()},
      {"next_frame", request.wants_flow ? Json(request.next_frame) : Json()},
      {"reference", {{"camera", json_of(request.reference.camera)}, {"rgb", reference.json()}}},
      {"views", Json::array()}};
  put(*memory_, reference, request.reference.rgb);
  for (size_t i = 0; i < places.size(); ++i) {
    const GuidanceView& view = request.views[i];
    const ViewPlaces& p = places[i];
    put(*memory_, p.rgb, view.rgb);
    Json entry{{"camera", json_of(view.camera)},
               {"azimuth", view.azimuth},
               {"elevation", view.elevation},
               {"distance", view.distance},
               {"timestep", timestep_share(rule_, request.progress, request.seed, uint32_t(i))},
               {"rgb", p.rgb.json()},
               {"gradient", p.gradient.json()}};
    if (request.wants_flow) {
      put(*memory_, p.flow, view.flow);
      entry["flow"] = p.flow.json();
      entry["target_flow"] = p.target_flow.json();
      entry["confidence"] = p.confidence.json();
    }
    line["views"].push_back(entry);
  }
  child_.send(line.dump(), time_out_);
  const Json answer = parsed(child_.receive(time_out_), name());
  memory_->forget_name();  // the program has opened it
  memory_->require_whole();
  if (!answer.contains("views") || !answer["views"].is_array() ||
      answer["views"].size() != places.size())
    throw GuidanceFailed(fmt::format("{} answered step {} without a list of {} views", name(),
                                     request.step, places.size()));
  std::vector<GuidanceAnswer> answers;
  for (size_t i = 0; i < places.size(); ++i) {
    const Json& view = answer["views"][i];
    if (!view.is_object())
      throw GuidanceFailed(
          fmt::format("{} answered step {} with {} for view {}, expected an object", name(),
                      request.step, view.dump(), i));
    answers.push_back(answer_of(view, places[i], *memory_, name()));
  }
  return answers;
}

}  // namespace gflow
