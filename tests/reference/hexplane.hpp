// SPDX-License-Identifier: Apache-2.0
// The field of the hexplane model in double, written out by its formulas (shared/hexplane.h):
// planes, features, network, shift; and what the planes should be like.
#pragma once
#include "optim/motion/hexplane_shape.hpp"
#include "reference/parameters.hpp"
#include "shared/shifted.h"

namespace gflow::reference {

// Planes of one level: value(row) [channels].
struct HexplaneLevel {
  const HexplaneShape& shape;
  const std::vector<double>& planes;
  size_t start, resolution;  // its first row

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

inline Shift hexplane_shift(const HexplaneShape& shape, double duration, const Named& p, real3 mean,
                            double t) {
  struct Place {
    size_t cell;
    double share;
  };
  const auto place = [](double unit, size_t count) -> Place {  // unit in [0, 1] or outside
    if (count < 2) return {0, 0};
    const double x = std::clamp(unit, 0.0, 1.0) * double(count - 1);
    const size_t cell = std::min(size_t(x), count - 2);
    return {cell, x - double(cell)};
  };
  const double xyz[3] = {mean.x, mean.y, mean.z};
  const Place time = place(t / duration, size_t(shape.times));
  std::vector<double> x;
  for (const HexplaneLevel& level : hexplane_levels(shape, p.at("planes"))) {
    Place on[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      const double low = double(shape.centre[axis]) - double(shape.half_size[axis]);
      on[axis] = place((xyz[axis] - low) / (2 * double(shape.half_size[axis])), level.resolution);
    }
    for (size_t c = 0; c < size_t(shape.channels); ++c) {
      double product = 1;
      const size_t axes[3][2] = {{0, 1}, {0, 2}, {1, 2}};
      for (size_t plane = 0; plane < 3; ++plane) {
        const Place u = on[axes[plane][0]], v = on[axes[plane][1]];
        double sum = 0;
        for (size_t b = 0; b < 2; ++b)
          for (size_t a = 0; a < 2; ++a)
            sum += (a ? u.share : 1 - u.share) * (b ? v.share : 1 - v.share) *
                   level.space(plane, v.cell + b, u.cell + a, c);
        product *= sum;
      }
      for (size_t axis = 0; axis < 3; ++axis) {
        const Place u = on[axis];
        double sum = 0;
        for (size_t b = 0; b < 2; ++b)
          for (size_t a = 0; a < 2; ++a) {
            const double weight = (a ? u.share : 1 - u.share) * (b ? time.share : 1 - time.share);
            if (weight != 0) sum += weight * level.time(time.cell + b, axis, u.cell + a, c);
          }
        product *= sum;
      }
      x.push_back(product);
    }
  }
  const std::vector<double>& w = p.at("network");
  size_t next = 0;
  for (int layer = 0; layer <= shape.layers; ++layer) {
    std::vector<double> out(layer == shape.layers ? 16 : size_t(shape.hidden));
    for (size_t j = 0; j < out.size(); ++j) {
      double sum = w[next + x.size() * out.size() + j];
      for (size_t k = 0; k < x.size(); ++k) sum += x[k] * w[next + k * out.size() + j];
      out[j] = layer == shape.layers ? sum : std::max(sum, 0.0);
    }
    next += (x.size() + 1) * out.size();
    x = out;
  }
  Shift d{{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}};
  d.mean = {double(shape.half_size[0]) * x[0], double(shape.half_size[1]) * x[1],
            double(shape.half_size[2]) * x[2]};
  if (shape.turn) d.quat = {x[3], x[4], x[5], x[6]};
  if (shape.resize) d.log_scales = {x[7], x[8], x[9]};
  return d;
}

// The three terms of PlaneRule, weighed.
inline double plane_cost(const HexplaneShape& shape, const PlaneRule& rule,
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
