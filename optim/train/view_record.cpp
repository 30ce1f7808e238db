// SPDX-License-Identifier: Apache-2.0
#include "optim/train/view_record.hpp"

#include <fmt/format.h>

#include <cstring>
#include <type_traits>

namespace gflow {
namespace {

static_assert(std::is_trivially_copyable<Shot>::value, "a shot is said as its bytes");

struct GradientArray {
  Buffer<float>* values;
  size_t width;
};

// Those of the first time; with flow those of the second, too.
std::vector<GradientArray> arrays_of(GaussianGradients& g, bool flow) {
  std::vector<GradientArray> arrays{
      {&g.v_means, 3}, {&g.v_factors, 9}, {&g.v_opacities, 1}, {&g.v_colors, 3}, {&g.v_means2d, 2}};
  if (flow) arrays.insert(arrays.end(), {{&g.v_means_t2, 3}, {&g.v_factors_t2, 9}});
  return arrays;
}

// Entries of the view that are drawn.
std::vector<size_t> drawn_in(Queue& queue, const Renderer& renderer) {
  const std::vector<cl_uint> touched =
      renderer.engine().splats().tiles_touched.read_range(queue, 0, renderer.rows().count());
  std::vector<size_t> entries;
  for (size_t k = 0; k < touched.size(); ++k)
    if (touched[k] > 0) entries.push_back(k);
  return entries;
}

template <class T>
void append_value(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <class T>
void take_value(const char*& bytes, T& value) {
  std::memcpy(static_cast<void*>(&value), bytes, sizeof value);
  bytes += sizeof value;
}

void append_floats(std::string& bytes, const std::vector<float>& values) {
  append_value(bytes, uint64_t(values.size()));
  bytes.append(reinterpret_cast<const char*>(values.data()), 4 * values.size());
}

std::vector<float> take_floats(const char*& bytes) {
  uint64_t size;
  take_value(bytes, size);
  std::vector<float> values(size);
  if (size > 0) std::memcpy(values.data(), bytes, 4 * size);
  bytes += 4 * size;
  return values;
}

}  // namespace

ViewRecord record_of(Queue& queue, Renderer& renderer, const Model& model, const Shot& shot) {
  ViewRecord record;
  record.shot = shot;
  if (shot.view.flow_tiles) record.flow_tiles = shot.view.flow_tiles->read(queue);
  record.shot.view.flow_tiles = nullptr;
  record.gaussians = model.parameters.count;
  record.moving = model.parameters.moving;
  record.intersections = renderer.engine().tiles().intersections;
  const std::vector<size_t> entries = drawn_in(queue, renderer);
  record.drawn = entries.size();
  for (const GradientArray& array : arrays_of(renderer.gradients(), shot.flow)) {
    const std::vector<float> all =
        array.values->read_range(queue, 0, array.width * renderer.rows().count());
    for (const size_t k : entries)
      record.gradients.insert(record.gradients.end(), &all[array.width * k],
                              &all[array.width * k] + array.width);
  }
  return record;
}

GaussianGradients& restore(Queue& queue, Renderer& renderer, Model& model, const ViewRecord& record,
                           Buffer<float>& tiles) {
  const Parameters& p = model.parameters;
  if (record.gaussians != p.count || record.moving != p.moving)
    throw Error(fmt::format(
        "training on several devices: one has {} Gaussians, {} of them dynamic, another {} and {}: "
        "one of them may have run out of memory; lower density.cap",
        record.gaussians, record.moving, p.count, p.moving));
  Shot shot = record.shot;
  if (!record.flow_tiles.empty()) {
    tiles.ensure(queue, record.flow_tiles.size());
    tiles.write(queue, record.flow_tiles);
    shot.view.flow_tiles = &tiles;
  }
  renderer.pose(queue, model, shot);
  const std::vector<size_t> entries = drawn_in(queue, renderer);
  if (entries.size() != record.drawn)
    throw Error(
        fmt::format("training on several devices: one draws {} Gaussians of a view, "
                    "another {}: they do not compute alike; use equal devices and drivers",
                    record.drawn, entries.size()));
  GaussianGradients& gradients = renderer.begin_gradients(queue);
  const float* from = record.gradients.data();
  std::vector<float> all;
  for (const GradientArray& array : arrays_of(gradients, shot.flow)) {
    all.assign(array.values->size(), 0.f);
    for (const size_t k : entries) {
      std::copy(from, from + array.width, &all[array.width * k]);
      from += array.width;
    }
    array.values->write(queue, all);
  }
  return gradients;
}

void append(std::string& bytes, const ViewRecord& record) {
  append_value(bytes, record.shot);
  for (const uint64_t number :
       {record.gaussians, record.moving, record.drawn, record.intersections})
    append_value(bytes, number);
  append_floats(bytes, record.flow_tiles);
  append_floats(bytes, record.gradients);
  append_value(bytes, uint64_t(record.taken.size()));
  for (const std::vector<float>& values : record.taken) append_floats(bytes, values);
}

ViewRecord take(const char*& bytes) {
  ViewRecord record;
  take_value(bytes, record.shot);
  for (uint64_t* number : {&record.gaussians, &record.moving, &record.drawn, &record.intersections})
    take_value(bytes, *number);
  record.flow_tiles = take_floats(bytes);
  record.gradients = take_floats(bytes);
  uint64_t objectives;
  take_value(bytes, objectives);
  for (uint64_t i = 0; i < objectives; ++i) record.taken.push_back(take_floats(bytes));
  return record;
}

}  // namespace gflow
