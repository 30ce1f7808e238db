// SPDX-License-Identifier: Apache-2.0
// The hexplane field in double, written from its formulas (shared/motion/hexplane.h): planes,
// features, network, shift, and their derivatives; and the regularisation of the planes.
#pragma once
#include <map>

#include "optim/motion/hexplane_options.hpp"
#include "optim/reference/network.hpp"
#include "optim/reference/parameters.hpp"
#include "shared/motion/hexplane.h"
#include "shared/motion/shifted.h"

namespace gflow::reference {

// Planes of one level: value(row) [channels].
struct HexplaneLevel {
  const HexplaneShape& shape;
  const std::vector<double>& planes;
  size_t start, resolution;  // start: its first row

  double space(size_t plane, size_t v, size_t u, size_t c) const {
    return at(start + (plane * resolution + v) * resolution + u, c);
  }
  double time(size_t k, size_t axis, size_t u, size_t c) const {
    return at(start + 3 * resolution * resolution + (k * 3 + axis) * resolution + u, c);
  }
  double at(size_t row, size_t c) const { return planes[row * size_t(shape.channels) + c]; }
};

inline std::vector<HexplaneLevel> hexplane_levels(const HexplaneShape& shape,
                                                  const std::vector<double>& planes) {
  std::vector<HexplaneLevel> levels;
  size_t start = 0, resolution = size_t(shape.resolution);
  for (int l = 0; l < shape.levels; ++l) {
    levels.push_back({shape, planes, start, resolution});
    start += 3 * resolution * resolution + 3 * resolution * size_t(shape.times);
    resolution *= 2;
  }
  return levels;
}

// Position between two cells: share in [0, 1], and slope = d share / d coordinate, 0 outside.
struct HexplanePlace {
  size_t cell = 0;
  double share = 0, slope = 0;
};
// `unit` is in [0, 1] inside the planes; per_unit = d unit / d coordinate.
inline HexplanePlace place_of(double unit, double per_unit, size_t count) {
  if (count < 2) return {};
  const double x = std::clamp(unit, 0.0, 1.0) * double(count - 1);
  const size_t cell = std::min(size_t(x), count - 2);
  return {cell, x - double(cell), unit >= 0 && unit <= 1 ? per_unit * double(count - 1) : 0};
}

// Rows in time and their weights at a time in [0, 1]. Of a cubic B-spline: its basis functions,
// with rows -1 and `count`, which continue the line through the two rows at that end.
inline std::map<size_t, double> time_weights(double unit, size_t count, bool spline) {
  if (count < 2) return {{0, 1}};
  const double x = std::clamp(unit, 0.0, 1.0) * double(count - 1);
  const auto basis = [&](double away) {
    const double d = std::fabs(away);
    if (!spline) return std::max(1 - d, 0.0);
    return d >= 2 ? 0 : std::pow(2 - d, 3) / 6 - (d < 1 ? 4 * std::pow(1 - d, 3) / 6 : 0);
  };
  std::map<size_t, double> weights;
  const auto add = [&](size_t row, double weight) {
    if (weight != 0) weights[row] += weight;
  };
  for (size_t k = 0; k < count; ++k) add(k, basis(x - double(k)));
  const double before = basis(x + 1), after = basis(x - double(count));
  add(0, 2 * before), add(1, -before);
  add(count - 1, 2 * after), add(count - 2, -after);
  return weights;
}

// A row of the planes that contributes to a factor of the features, its weight, and the derivative
// of the weight by the mean.
struct HexplaneTerm {
  size_t row;
  double weight;
  std::array<double, 3> slope;
};

// The six factors of a level's features at a position and time: XY XZ YZ XT YT ZT.
inline std::array<std::vector<HexplaneTerm>, 6> hexplane_terms(const HexplaneLevel& level,
                                                               const double (&mean)[3],
                                                               double time_unit) {
  const HexplaneShape& shape = level.shape;
  HexplanePlace on[3];
  for (size_t axis = 0; axis < 3; ++axis) {
    const double size = 2 * double(shape.half_size[axis]);
    const double low = double(shape.centre[axis]) - 0.5 * size;
    on[axis] = place_of((mean[axis] - low) / size, 1 / size, level.resolution);
  }
  const std::map<size_t, double> times =
      time_weights(time_unit, size_t(shape.times), shape.time_spline != 0);
  const size_t r = level.resolution, axes[6][2] = {{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}};
  std::array<std::vector<HexplaneTerm>, 6> terms;
  for (size_t f = 0; f < 6; ++f) {
    const size_t u = axes[f][0], v = axes[f][1];
    std::map<size_t, double> rows = times;
    if (v < 3) rows = {{on[v].cell, 1 - on[v].share}, {on[v].cell + 1, on[v].share}};
    for (const auto& [row, wv] : rows)
      for (size_t a = 0; a < 2; ++a) {
        const double wu = a ? on[u].share : 1 - on[u].share;
        const size_t cell_u = on[u].cell + a;
        HexplaneTerm term{level.start, wu * wv, {}};
        term.row += f < 3 ? (f * r + row) * r + cell_u : 3 * r * r + (row * 3 + u) * r + cell_u;
        term.slope[u] += (a ? 1 : -1) * on[u].slope * wv;
        if (v < 3) term.slope[v] += (row > on[v].cell ? 1 : -1) * on[v].slope * wu;
        terms[f].push_back(term);
      }
  }
  return terms;
}

// A factor in one channel.
inline double hexplane_factor(const HexplaneLevel& level, const std::vector<HexplaneTerm>& terms,
                              size_t channel) {
  double sum = 0;
  for (const HexplaneTerm& term : terms) sum += term.weight * level.at(term.row, channel);
  return sum;
}

// The inputs of each layer of the network, features first, and the outputs of the last.
inline std::vector<std::vector<double>> hexplane_layers(const HexplaneShape& shape, double duration,
                                                        const Named& p, const double (&mean)[3],
                                                        double t) {
  std::vector<double> features;
  for (const HexplaneLevel& level : hexplane_levels(shape, p.at("planes"))) {
    const auto terms = hexplane_terms(level, mean, t / duration);
    for (size_t c = 0; c < size_t(shape.channels); ++c) {
      double product = 1;
      for (const auto& factor : terms) product *= hexplane_factor(level, factor, c);
      features.push_back(product);
    }
  }
  return network_layers(shape.hidden, shape.layers, p.at("network"), features);
}

inline Shift hexplane_shift(const HexplaneShape& shape, double duration, const Named& p, real3 mean,
                            double t) {
  const std::vector<double> o =
      hexplane_layers(shape, duration, p, {mean.x, mean.y, mean.z}, t).back();
  Shift d{{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}};
  d.mean = {double(shape.half_size[0]) * o[0], double(shape.half_size[1]) * o[1],
            double(shape.half_size[2]) * o[2]};
  if (shape.turn) d.quat = {o[3], o[4], o[5], o[6]};
  const double most = HEXPLANE_MAX_LOG_SCALE;
  if (shape.resize)
    d.log_scales = {most * std::tanh(o[7] / most), most * std::tanh(o[8] / most),
                    most * std::tanh(o[9] / most)};
  return d;
}

// Gradient of the sum of shift x v.
struct HexplaneGradient {
  std::vector<double> planes, network, mean;
};
inline HexplaneGradient hexplane_vjp(const HexplaneShape& shape, double duration, const Named& p,
                                     real3 mean, double t, const Shift& v) {
  const double place[3] = {mean.x, mean.y, mean.z};
  const auto x = hexplane_layers(shape, duration, p, place, t);
  const std::vector<double>&w = p.at("network"), &o = x.back();
  std::vector<double> v_out(NETWORK_OUTPUTS, 0.0);
  const double v_mean[3] = {v.mean.x, v.mean.y, v.mean.z};
  for (size_t k = 0; k < 3; ++k) v_out[k] = double(shape.half_size[k]) * v_mean[k];
  const double v_quat[4] = {v.quat.x, v.quat.y, v.quat.z, v.quat.w};
  if (shape.turn) std::copy(v_quat, v_quat + 4, v_out.begin() + 3);
  const double v_size[3] = {v.log_scales.x, v.log_scales.y, v.log_scales.z};
  for (size_t k = 0; shape.resize && k < 3; ++k)
    v_out[7 + k] = v_size[k] / std::pow(std::cosh(o[7 + k] / HEXPLANE_MAX_LOG_SCALE), 2);

  HexplaneGradient g{std::vector<double>(p.at("planes").size()), std::vector<double>(w.size()),
                     std::vector<double>(3)};
  v_out = network_vjp(w, x, v_out, g.network);
  size_t feature = 0;
  for (const HexplaneLevel& level : hexplane_levels(shape, p.at("planes"))) {
    const auto terms = hexplane_terms(level, place, t / duration);
    for (size_t c = 0; c < size_t(shape.channels); ++c, ++feature)
      for (size_t f = 0; f < 6; ++f) {
        double others = v_out[feature];
        for (size_t e = 0; e < 6; ++e)
          if (e != f) others *= hexplane_factor(level, terms[e], c);
        for (const HexplaneTerm& term : terms[f]) {
          g.planes[term.row * size_t(shape.channels) + c] += others * term.weight;
          for (size_t axis = 0; axis < 3; ++axis)
            g.mean[axis] += others * term.slope[axis] * level.at(term.row, c);
        }
      }
  }
  return g;
}

// The weighted sum of the regularisers of the planes.
inline double plane_cost(const HexplaneShape& shape, const HexplaneOptions& rule,
                         const std::vector<double>& planes) {
  double cost = 0;
  const size_t channels = size_t(shape.channels), times = size_t(shape.times);
  for (const HexplaneLevel& level : hexplane_levels(shape, planes)) {
    const size_t r = level.resolution;
    double tv = 0, bend = 0, away = 0;
    const auto square = [](double x) { return x * x; };
    for (size_t c = 0; c < channels; ++c) {
      for (size_t plane = 0; plane < 3; ++plane)
        for (size_t v = 0; v < r; ++v)
          for (size_t u = 0; u + 1 < r; ++u) {
            tv += square(level.space(plane, v, u + 1, c) - level.space(plane, v, u, c));
            tv += square(level.space(plane, u + 1, v, c) - level.space(plane, u, v, c));
          }
      for (size_t axis = 0; axis < 3; ++axis)
        for (size_t u = 0; u < r; ++u)
          for (size_t k = 0; k < times; ++k) {
            away += std::fabs(level.time(k, axis, u, c) - 1);
            if (k + 2 < times)
              bend += square(level.time(k, axis, u, c) - 2 * level.time(k + 1, axis, u, c) +
                             level.time(k + 2, axis, u, c));
          }
    }
    const double rows = double(r * channels);
    cost += double(rule.plane_tv) * tv / (rows * double(r - 1));
    cost += double(rule.l1_time) * away / (rows * double(times));
    if (times > 2) cost += double(rule.time_smoothness) * bend / (rows * double(times - 2));
  }
  return cost;
}

}  // namespace gflow::reference
