// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/plane_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "optim/motion/motion_options.hpp"
#include "runtime/cl/chunks.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kPlanesGroup = 64;
// Least thickness of the box, of its longest side. What moves may begin as flat as a sheet, when all
// of it lies at one depth: in a box as thin, a step of training would carry it past whole cells.
constexpr float kThinnest = 0.1f;

// The weights of the rows at time t / duration. A spline goes on straight beyond both ends: row -1
// is 2 row 0 - row 1.
TimeRows time_rows(double moment, int times, bool spline) {
  const double place = std::clamp(moment, 0.0, 1.0) * (times - 1);
  const int cell = std::min(int(place), std::max(times - 2, 0));
  const double s = place - cell, r = 1 - s;
  std::array<double, 4> w{0, r, s, 0};
  if (spline)
    w = {r * r * r / 6, (3 * s * s * s - 6 * s * s + 4) / 6, (3 * r * r * r - 6 * r * r + 4) / 6,
         s * s * s / 6};
  if (times == 1) w = {0, 1, 0, 0};
  if (cell + 2 > times - 1) w[2] += 2 * w[3], w[1] -= w[3], w[3] = 0;
  if (cell == 0) w[1] += 2 * w[0], w[2] -= w[0], w[0] = 0;
  TimeRows rows{cell - 1, {}};
  std::copy(w.begin(), w.end(), rows.weight);
  return rows;
}

uint planes_rows(const HexplaneShape& s) {
  return hexplane_level_start(uint(s.resolution), uint(s.times), s.levels);
}
NetworkShape network_of(const HexplaneShape& s) {
  return {s.levels * s.channels, s.hidden, s.layers};
}

// Returns the shape; Error if a number of it is out of range.
const HexplaneShape& checked(const HexplaneShape& s) {
  const auto among = [](int value, std::initializer_list<int> values) {
    return std::find(values.begin(), values.end(), value) != values.end();
  };
  const auto check = [](bool right, const char* what, auto value, const char* allowed) {
    if (!right)
      throw Error(fmt::format("hexplane model: {} must be {}, not {}", what, allowed, value));
  };
  check(s.levels >= 1 && s.levels <= 4, "levels", s.levels, "1 to 4");
  check(s.resolution >= 2 && s.resolution <= 1024, "resolution", s.resolution, "2 to 1024");
  check(s.times >= 1 && s.times <= 10000, "time rows", s.times, "1 to 10000");
  check(among(s.channels, {16, 32, 64}), "channels", s.channels, "16, 32 or 64");
  check(among(s.hidden, {32, 64, 128, 256}), "hidden neurons", s.hidden, "32, 64, 128 or 256");
  check(s.layers >= 1 && s.layers <= 4, "hidden layers", s.layers, "1 to 4");
  for (const float h : s.half_size)
    check(h > 0 && std::isfinite(h), "half size", h, "above 0 and finite");
  return s;
}

// Chunks of Gaussians, each with its own copy of the planes' gradients. Few, because the copies
// must be summed.
Chunks plane_chunks(const Queue& queue, size_t n) {
  return chunks_of_sums(n, 256, queue.lanes == 1 ? 64 : 4);
}
template <int HexplaneOptions::*number>
int& member(MotionShape& shape) {
  return shape.hexplane.*number;
}
int& time_spline(MotionShape& shape) { return shape.hexplane.time_spline; }
template <size_t axis>
float& centre(MotionShape& shape) {
  return shape.hexplane.centre[axis];
}
template <size_t axis>
float& half_size(MotionShape& shape) {
  return shape.hexplane.half_size[axis];
}

}  // namespace

HexplaneGrid grid_of(const HexplaneShape& s) {
  HexplaneGrid grid{s.resolution, s.times, {}, {}};
  std::copy(s.centre.begin(), s.centre.end(), grid.centre);
  std::copy(s.half_size.begin(), s.half_size.end(), grid.half_size);
  return grid;
}

Defines field_defines(const HexplaneShape& s) {
  Defines all = network_defines(network_of(s));
  all.insert(all.end(), {{"LEVELS", s.levels},
                         {"CHANNELS", s.channels},
                         {"TURN", int(s.turn)},
                         {"RESIZE", int(s.resize)}});
  return all;
}

std::vector<TableSpec> field_tables(const HexplaneShape& shape) {
  const HexplaneShape& s = checked(shape);
  TableSpec planes;
  planes.groups = {{"planes", size_t(s.channels), Quantity::plane, 0, true}};
  planes.rows = planes_rows(s);
  return {planes, network_table(network_of(s))};
}

void set_field_static(const HexplaneShape& s, HostGroups& groups, uint32_t seed) {
  std::vector<float>& planes = groups["planes"];
  const size_t channels = size_t(s.channels);
  planes.assign(planes_rows(s) * channels, 1.f);
  for (int level = 0; level < s.levels; ++level) {
    const size_t first = hexplane_level_start(uint(s.resolution), uint(s.times), level) * channels;
    const size_t r = size_t(s.resolution) << level;
    for (size_t i = first; i < first + 3 * r * r * channels; ++i)
      planes[i] = float(0.1 + 0.4 * random_uniform(seed, streams::kPlanes, uint(i)));
  }
  groups["network"] = first_weights(network_of(s), seed);
}

bool is_field_static(const HexplaneShape& s, const HostGroups& groups) {
  return gives_zero(network_of(s), groups.at("network"));
}

void set_box(HexplaneShape& shape, const std::vector<float>& xyz, float slack) {
  const size_t n = xyz.size() / 3;
  if (n == 0) return;
  for (size_t axis = 0; axis < 3; ++axis) {
    std::vector<float> places;
    for (size_t i = 0; i < n; ++i) places.push_back(xyz[3 * i + axis]);
    std::sort(places.begin(), places.end());
    const float low = places[n / 100], high = places[n - 1 - n / 100];
    shape.centre[axis] = 0.5f * (low + high);
    shape.half_size[axis] = std::max(0.5f * (1 + slack) * (high - low), 1e-6f);
  }
  const float longest = *std::max_element(shape.half_size.begin(), shape.half_size.end());
  for (float& half_size : shape.half_size) half_size = std::max(half_size, kThinnest * longest);
}

std::vector<ShapeNumber> field_numbers() {
  return {{"resolution", member<&HexplaneShape::resolution>, 1, 1e4},
          {"levels", member<&HexplaneShape::levels>, 0, 16},
          {"channels", member<&HexplaneShape::channels>, 0, 1e3},
          {"hidden", member<&HexplaneShape::hidden>, 0, 1e3},
          {"layers", member<&HexplaneShape::layers>, 0, 1e3}};
}

std::vector<ShapeNumber> kept_field_numbers() {
  return {{"centre_x", centre<0>, -1e30, 1e30},
          {"half_size_x", half_size<0>, 0, 1e30},
          {"centre_y", centre<1>, -1e30, 1e30},
          {"half_size_y", half_size<1>, 0, 1e30},
          {"centre_z", centre<2>, -1e30, 1e30},
          {"half_size_z", half_size<2>, 0, 1e30},
          {"times", member<&HexplaneShape::times>, 0, 1e6},
          {"time_spline", time_spline, -1, 1}};
}

void set_field_numbers(MotionShape& shape, const MotionOptions& options, int time_steps) {
  static_cast<HexplaneOptions&>(shape.hexplane) = options.hexplane;
  constexpr int enough = 25;  // for 100 time steps, 13 and 50 rows were worse; for 60, 15
  const int half = (time_steps + 1) / 2, quarter = (time_steps + 3) / 4;
  if (shape.hexplane.times == 0) shape.hexplane.times = std::max(quarter, std::min(half, enough));
}

void enclose_in_box(MotionShape& shape, const std::vector<float>& means,
                    const MotionOptions& options) {
  set_box(shape.hexplane, means, options.hexplane.slack);
  shape.hexplane.time_spline = 1;
}

PlaneField::PlaneField(Queue& queue, Program& program, const HexplaneShape& shape, float duration)
    : shape_(checked(shape)),
      grid_(grid_of(shape)),
      duration_(duration),
      lanes_(size_t(queue.lanes)),
      cells_(hexplane_level_start(uint(shape.resolution), 1, shape.levels)),
      hexplane_cut_(program, "hexplane_slice"),
      hexplane_bwd_planes_(program, "hexplane_bwd_planes"),
      hexplane_bwd_means_(program, "hexplane_bwd_means"),
      hexplane_sum_planes_(program, "hexplane_sum_planes"),
      hexplane_regularize_(program, "hexplane_regularize"),
      network_(program, network_of(shape), queue.lanes) {}

void PlaneField::cut(Queue& queue, const Parameters& p, float t) {
  time_ = time_rows(double(t) / duration_, shape_.times, shape_.time_spline != 0);
  const size_t r = size_t(shape_.resolution);
  const size_t vectors =
      3 * r * ((size_t(1) << shape_.levels) - 1) * size_t(shape_.channels) / lanes_;
  lines_.ensure(queue, vectors * lanes_);
  hexplane_cut_(queue, Range::over(vectors, kPlanesGroup), grid_, time_, p["planes"].values,
                lines_);
}

void PlaneField::begin(Queue& queue, const Parameters& p, float t, size_t n, const Chunks& chunks) {
  cut(queue, p, t);
  v_features_.ensure(queue, n * size_t(shape_.levels * shape_.channels));
  network_.begin(queue, p["network"].values, n, chunks);
}

void PlaneField::finish(Queue& queue, Parameters& p, size_t n, const Buffer<cl_uint>& used,
                        const Buffer<float>& places, Buffer<float>& v_places) {
  Table &planes = p.more[p.more.size() - 2], &network = p.more.back();
  network_.finish(queue, used, network);
  const Chunks copies = plane_chunks(queue, n);
  const size_t parts = size_t(shape_.levels * shape_.channels) / lanes_;
  v_cuts_.ensure(queue, copies.count * cells_ * size_t(shape_.channels));
  v_places_.ensure(queue, n * parts * 3);
  hexplane_bwd_planes_(queue, Range::groups(copies.count * parts, 1), cl_uint(n), copies.length,
                       grid_, used, places, p["planes"].values, lines_, v_features_, v_cuts_,
                       v_places_);
  hexplane_bwd_means_(queue, Range::over(n, kPlanesGroup), cl_uint(n), used, v_places_, v_places);
  hexplane_sum_planes_(queue, Range::over(cells_, kPlanesGroup), copies.count, grid_, time_,
                       v_cuts_, planes.rows.seen, p["planes"].grads);
  planes.active = {0, planes.count};
}

void PlaneField::regularize(Queue& queue, Parameters& p, const HexplaneOptions& rule) {
  if (rule.plane_tv == 0 && rule.time_smoothness == 0 && rule.l1_time == 0) return;
  Table& planes = p.more[p.more.size() - 2];
  hexplane_regularize_(queue, Range::over(planes.count, kPlanesGroup), grid_, rule.plane_tv,
                       rule.time_smoothness, rule.l1_time, p["planes"].values, planes.rows.seen,
                       p["planes"].grads);
  planes.active = {0, planes.count};
}

}  // namespace gflow
