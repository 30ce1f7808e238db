// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/hexplane.hpp"

#include <algorithm>
#include <cmath>

#include "optim/engine/random_streams.hpp"
#include "optim/motion/motion_options.hpp"
#include "runtime/cl/chunks.hpp"
#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kGroup = 64;

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

Defines defines(const HexplaneShape& s) {
  Defines all = network_defines(network_of(s));
  all.insert(all.end(), {{"LEVELS", s.levels},
                         {"CHANNELS", s.channels},
                         {"TURN", int(s.turn)},
                         {"RESIZE", int(s.resize)}});
  return all;
}

// Chunks of Gaussians, each with its own copy of the planes' gradients. Few, because the copies
// must be summed.
Chunks plane_chunks(const Queue& queue, size_t n) {
  return chunks_of_sums(n, 256, queue.lanes == 1 ? 64 : 4);
}
// Chunks of Gaussians, each with its own copy of the network's gradients.
Chunks network_chunks(const Queue& queue, size_t n) {
  return chunks_of_sums(n, 128, queue.lanes == 1 ? 32 : 16);
}

}  // namespace

HexplaneGrid grid_of(const HexplaneShape& s) {
  HexplaneGrid grid{s.resolution, s.times, {}, {}};
  std::copy(s.centre.begin(), s.centre.end(), grid.centre);
  std::copy(s.half_size.begin(), s.half_size.end(), grid.half_size);
  return grid;
}

std::vector<TableSpec> hexplane_tables(const HexplaneShape& shape) {
  const HexplaneShape& s = checked(shape);
  TableSpec planes;
  planes.groups = {{"planes", size_t(s.channels), Quantity::plane, 0, true}};
  planes.rows = planes_rows(s);
  return {planes, network_table(network_of(s))};
}

void set_hexplane_static(const HexplaneShape& s, HostGroups& groups, uint32_t seed) {
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

bool is_hexplane_static(const HexplaneShape& s, const HostGroups& groups) {
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
}

HexplaneMotion::HexplaneMotion(Queue& queue, const MotionShape& shape)
    : shape_(checked(shape.hexplane)),
      grid_(grid_of(shape_)),
      duration_(shape.duration),
      sigmas_(window_sigmas(shape.cutoff)),
      lanes_(size_t(queue.lanes)),
      cells_(hexplane_level_start(uint(shape_.resolution), 1, shape_.levels)),
      program_(queue, "motion/hexplane.cl", defines(shape_)),
      hexplane_cut_(program_, "hexplane_slice"),
      hexplane_fwd_(program_, "hexplane_fwd"),
      hexplane_bwd_(program_, "hexplane_bwd"),
      hexplane_bwd_planes_(program_, "hexplane_bwd_planes"),
      hexplane_bwd_means_(program_, "hexplane_bwd_means"),
      hexplane_sum_planes_(program_, "hexplane_sum_planes"),
      hexplane_regularize_(program_, "hexplane_regularize"),
      network_(program_, network_of(shape_), queue.lanes),
      canonical_rows_(queue) {}

HexplaneMotion::TimePlace HexplaneMotion::cut(Queue& queue, const Parameters& p, float t) {
  const double place = std::clamp(double(t) / duration_, 0.0, 1.0) * (shape_.times - 1);
  const int row = std::min(int(place), std::max(shape_.times - 2, 0));
  const TimePlace at{row, float(place - row)};
  const size_t r = size_t(shape_.resolution);
  const size_t vectors =
      3 * r * ((size_t(1) << shape_.levels) - 1) * size_t(shape_.channels) / lanes_;
  lines_.ensure(queue, vectors * lanes_);
  hexplane_cut_(queue, Range::over(vectors, kGroup), grid_, at.row, at.share, p["planes"].values,
                lines_);
  return at;
}

void HexplaneMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                        GaussiansAt& gaussians, const RowList&) {
  gaussians.ensure(queue, p.count);
  cut(queue, p, t);
  const size_t per_item = lanes_ == 1 ? 1 : 256;
  hexplane_fwd_(queue, Range::over((p.count + per_item - 1) / per_item, lanes_ == 1 ? kGroup : 1),
                cl_uint(p.count), cl_uint(per_item), t, sigmas_, int(!seen), grid_,
                seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                p["quats"].values, p["log_scales"].values, p["logit_opacities"].values,
                p["planes"].values, lines_, p["network"].values, gaussians.means, gaussians.factors,
                gaussians.opacities);
}

void HexplaneMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                              const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                              const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                              const RowList&) {
  const size_t n = p.count, features = size_t(shape_.levels * shape_.channels);
  const bool gpu = lanes_ == 1;
  const TimePlace place = cut(queue, p, t);
  const Chunks chunks = network_chunks(queue, n);
  v_features_.ensure(queue, n * features);
  network_.begin(queue, p["network"].values, n, chunks);
  hexplane_bwd_(queue, gpu ? Range::over(n, kGroup) : Range::groups(chunks.count, 1), cl_uint(n),
                gpu ? 1u : chunks.length, t, int(first), grid_, p["means"].values,
                p["means_t"].values, p["quats"].values, p["log_scales"].values,
                p["logit_opacities"].values, p["planes"].values, lines_, p["network"].values,
                network_.transposed(), tiles_touched, v_means, v_factors, v_opacities, p.rows.seen,
                p["means"].grads, p["means_t"].grads, p["quats"].grads, p["log_scales"].grads,
                p["logit_opacities"].grads, v_features_, network_.sums(), network_.kept());
  network_.finish(queue, tiles_touched, p.more[1]);
  Table& planes = p.more[0];

  const Chunks copies = plane_chunks(queue, n);
  const size_t parts = features / lanes_;
  v_cuts_.ensure(queue, copies.count * cells_ * size_t(shape_.channels));
  v_places_.ensure(queue, n * parts * 3);
  hexplane_bwd_planes_(queue, Range::groups(copies.count * parts, 1), cl_uint(n), copies.length,
                       grid_, tiles_touched, p["means"].values, p["planes"].values, lines_,
                       v_features_, v_cuts_, v_places_);
  hexplane_bwd_means_(queue, Range::over(n, kGroup), cl_uint(n), tiles_touched, v_places_,
                      p["means"].grads);
  hexplane_sum_planes_(queue, Range::over(cells_, kGroup), copies.count, grid_, place.row,
                       place.share, v_cuts_, planes.rows.seen, p["planes"].grads);
  planes.active = {0, planes.count};
}

void HexplaneMotion::regularize(Queue& queue, Parameters& p, const MotionOptions& options) {
  const HexplaneOptions& rule = options.hexplane;
  if (rule.plane_tv == 0 && rule.time_smoothness == 0 && rule.l1_time == 0) return;
  Table& planes = p.more[0];
  hexplane_regularize_(queue, Range::over(planes.count, kGroup), grid_, rule.plane_tv,
                       rule.time_smoothness, rule.l1_time, p["planes"].values, planes.rows.seen,
                       p["planes"].grads);
  planes.active = {0, planes.count};
}

void HexplaneMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_rows_.set_rate_scales(queue, p, rule);
}

void HexplaneMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                           const SplitRule& rule, uint32_t seed) {
  canonical_rows_.split(queue, p, child, rule, seed);
}

namespace {

template <int HexplaneOptions::*number>
int& member(MotionShape& shape) {
  return shape.hexplane.*number;
}
template <size_t axis>
float& centre(MotionShape& shape) {
  return shape.hexplane.centre[axis];
}
template <size_t axis>
float& half_size(MotionShape& shape) {
  return shape.hexplane.half_size[axis];
}

}  // namespace

const MotionModel& hexplane_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "hexplane";
    m.is_permanent = true;
    m.numbers = {{"resolution", member<&HexplaneShape::resolution>, 1, 1e4},
                 {"times", member<&HexplaneShape::times>, 0, 1e6},
                 {"levels", member<&HexplaneShape::levels>, 0, 16},
                 {"channels", member<&HexplaneShape::channels>, 0, 1e3},
                 {"hidden", member<&HexplaneShape::hidden>, 0, 1e3},
                 {"layers", member<&HexplaneShape::layers>, 0, 1e3}};
    m.numbers_of_gaussians = {
        {"centre_x", centre<0>, -1e30, 1e30}, {"half_size_x", half_size<0>, 0, 1e30},
        {"centre_y", centre<1>, -1e30, 1e30}, {"half_size_y", half_size<1>, 0, 1e30},
        {"centre_z", centre<2>, -1e30, 1e30}, {"half_size_z", half_size<2>, 0, 1e30}};
    m.set_numbers = [](MotionShape& shape, const MotionOptions& options, int time_steps) {
      static_cast<HexplaneOptions&>(shape.hexplane) = options.hexplane;
      if (shape.hexplane.times == 0) shape.hexplane.times = (time_steps + 1) / 2;
    };
    m.enclose = [](MotionShape& shape, const std::vector<float>& means,
                   const MotionOptions& options) {
      set_box(shape.hexplane, means, options.hexplane.slack);
    };
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<HexplaneMotion>(queue, shape);
    };
    m.groups = [](const MotionShape&) { return canonical_groups(); };
    m.tables = [](const MotionShape& shape) { return hexplane_tables(shape.hexplane); };
    m.set_static = [](const MotionShape& shape, HostGroups& groups, size_t, uint32_t seed) {
      set_hexplane_static(shape.hexplane, groups, seed);
    };
    m.is_static = [](const MotionShape& shape, const HostGroups& groups) {
      return is_hexplane_static(shape.hexplane, groups);
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
