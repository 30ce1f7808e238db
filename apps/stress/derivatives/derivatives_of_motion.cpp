// SPDX-License-Identifier: Apache-2.0
// Derivatives of the motion models.
#include "apps/stress/derivatives/differences.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/options/train_options.hpp"
#include "optim/reference/device_scene.hpp"
#include "optim/reference/flat_static.hpp"
#include "optim/reference/motion_models.hpp"

namespace gflow::stress {

std::vector<Derivative> motion_derivatives(Queue& queue);

namespace {

using reference::Named;

constexpr size_t kCount = 17;
constexpr double kTimes[2] = {.4, .9};

// Cotangents of mean, factor and opacity of Gaussian i at time k.
struct Ask {
  std::vector<float> means[2], factors[2], opacities;
  double of(const Shifted& o, size_t i, int k) const {
    const auto row = [](const std::vector<float>& a, size_t j) {
      return make_real3(a[3 * j], a[3 * j + 1], a[3 * j + 2]);
    };
    const double sum = dot(o.mean, row(means[k], i)) + dot(o.factor.r1, row(factors[k], 3 * i)) +
                       dot(o.factor.r2, row(factors[k], 3 * i + 1)) +
                       dot(o.factor.r3, row(factors[k], 3 * i + 2));
    return k == 0 ? sum + o.life.opacity * double(opacities[i]) : sum;
  }
};

Ask random_ask() {
  Random random(51);
  Ask ask;
  const auto fill = [&](std::vector<float>& a, size_t n) {
    for (size_t i = 0; i < n; ++i) a.push_back(float(random.normal()));
  };
  for (int k = 0; k < 2; ++k) {
    fill(ask.means[k], 3 * kCount);
    fill(ask.factors[k], 9 * kCount);
  }
  fill(ask.opacities, kCount);
  return ask;
}

// The device's gradient of two times against extrapolated differences of the model in double
// (accurate to 1e-9), for every group. The steps are small because the relu of networks has a kink.
// Returns the error of the worst group.
double device_error(Queue& queue, const MotionShape& shape, std::string& groups) {
  const std::unique_ptr<Motion> motion = make_motion(queue, shape);
  Parameters p(queue, kCount, motion->groups(), motion->tables());
  const reference::DoubleForward forward = reference::forward_of(shape);
  Random random(52);
  Named values;
  for (Table* table : p.tables())
    for (ParameterGroup& group : table->groups) {
      const std::string& name = group.values.name();
      const bool small =
          name == "network" || name == "planes" || name.find("turns") != std::string::npos;
      std::vector<float> floats;
      for (size_t k = 0; k < group.values.size(); ++k)
        floats.push_back(float((small ? .15 : .4) * random.uniform(-1, 1)) +
                         (name == "planes" ? 1 : 0));
      if (name == "quats" || name == "quats_r" || name == "basis_turns")
        for (size_t k = 0; k < floats.size(); k += 4) floats[k] += 1;  // not near zero length
      group.values.write(queue, floats);
      values[name] = {floats.begin(), floats.end()};
    }
  const Ask ask = random_ask();
  p.forget_seen(queue);
  const Buffer<cl_uint> seen(queue, std::vector<cl_uint>(kCount, 1u), "tiles_touched");
  const Buffer<float> by_opacity(queue, ask.opacities, "v");
  GaussiansAt at;
  motion->at(queue, p, float(kTimes[0]), nullptr, at);
  for (int k = 0; k < 2; ++k)
    motion->backward(queue, p, float(kTimes[k]), k == 0, seen,
                     Buffer<float>(queue, ask.means[k], "v"),
                     Buffer<float>(queue, ask.factors[k], "v"), by_opacity);
  double worst_error = 0;
  for (const Table* table : p.tables()) {
    const std::vector<cl_uint> rows = table->rows.seen.read(queue);
    for (const ParameterGroup& group : table->groups) {
      const std::string& name = group.values.name();
      if (name == "pivots") continue;  // not trained
      groups += (groups.empty() ? "" : " ") + name;
      Named moved = values;
      const auto loss = [&](const std::vector<double>& x) {
        moved[name] = x;
        double sum = 0;
        for (size_t i = 0; i < kCount; ++i)
          for (int k = 0; k < 2; ++k)
            sum += ask.of(forward(moved, i, double(float(kTimes[k]))), i, k);
        return sum;
      };
      std::vector<float> found = group.grads.read(queue);
      for (size_t k = 0; k < found.size(); ++k)
        if (!rows[k / group.width]) found[k] = 0;  // a key used at neither time: undefined
      const std::vector<size_t> some = spread_indices(found.size(), 150);
      worst_error = worse(
          worst_error, relative_error(picked(found, some), slopes(loss, values[name], 1e-5, some)));
    }
  }
  return worst_error;
}

std::vector<double> random_numbers(Random& random, size_t n) {
  std::vector<double> x(n);
  for (double& y : x) y = random.uniform(-1, 1);
  return x;
}
real3 three(const std::vector<double>& x, size_t at) { return {x[at], x[at + 1], x[at + 2]}; }
real4 four(const std::vector<double>& x, size_t at) {
  return {x[at], x[at + 1], x[at + 2], x[at + 3]};
}

// The worst of 30 random points: derivative(x) against slopes of loss(x).
template <class Derivative, class Loss>
double text_error(size_t numbers, Derivative&& derivative, Loss&& loss) {
  Random random(53);
  double most = 0;
  for (int round = 0; round < 30; ++round) {
    const std::vector<double> x = random_numbers(random, numbers);
    const double error = relative_error(derivative(x), slopes(loss, x, 1e-3));
    most = error <= most ? most : error;
  }
  return most;
}

const real3 kMean{.3, -.7, .5};
const Mat3 kFactor{{.2, -.5, .9}, {-.3, .8, .1}, {.6, .4, -.2}};
constexpr double kOpacity = .7, kTime = .2;
double asked(real3 mean, const Mat3& l, const Life& life) {
  return dot(mean, kMean) + life.opacity * kOpacity + dot(l.r1, kFactor.r1) +
         dot(l.r2, kFactor.r2) + dot(l.r3, kFactor.r3);
}

double spacetime_text() {
  return text_error(
      23,
      [](const std::vector<double>& x) {
        return reference::flat(
            spacetime_vjp(reference::spacetime_from(x), kTime, kMean, kFactor, kOpacity));
      },
      [](const std::vector<double>& x) {
        const SpacetimeSlice c = spacetime_at(reference::spacetime_from(x), kTime);
        return asked(c.mean, c.factor, c.life);
      });
}

double native4d_text() {
  const auto from = [](const std::vector<double>& x) {
    return Native4d{three(x, 0), x[3], four(x, 4), four(x, 8), four(x, 12), x[16]};
  };
  return text_error(
      17,
      [&](const std::vector<double>& x) {
        const Native4d v = slice_vjp(from(x), kTime, kMean, kFactor, kOpacity);
        std::vector<double> g{v.mean.x, v.mean.y, v.mean.z, v.mean_t};
        for (const real4 q : {v.quat, v.quat_r, v.log_scales})
          g.insert(g.end(), {q.x, q.y, q.z, q.w});
        g.push_back(v.logit_opacity);
        return g;
      },
      [&](const std::vector<double>& x) {
        const Slice c = slice_at(from(x), kTime);
        return asked(c.mean, c.factor, c.life);
      });
}

double shifted_text() {  // keyframes: the path is linear in its keys
  return text_error(
      23,
      [](const std::vector<double>& x) {
        return reference::canonical_and_shift(shifted_vjp(reference::canonical_from(x),
                                                          reference::shift_from(x), kTime, kMean,
                                                          kFactor, kOpacity));
      },
      [](const std::vector<double>& x) {
        const Shifted o = shifted_at(reference::canonical_from(x), reference::shift_from(x), kTime);
        return asked(o.mean, o.factor, o.life);
      });
}

double basis_text() {
  const real3 m{.1, .4, -.6}, pivot{-.2, .3, .1};
  const real4 v_turn{.3, -.1, .8, .5};
  const auto pose = [&](const std::vector<double>& x) {
    return BasisPose{four(x, 0), three(x, 4), pivot};
  };
  return text_error(
      7,
      [&](const std::vector<double>& x) {
        const BasisPose v = basis_pose_vjp(pose(x), .6, m, kMean, v_turn);
        return std::vector<double>{v.quat.x,  v.quat.y,  v.quat.z, v.quat.w,
                                   v.shift.x, v.shift.y, v.shift.z};
      },
      [&](const std::vector<double>& x) {
        return .6 * (dot(basis_shift(pose(x), m), kMean) + dot(basis_turn(pose(x)), v_turn));
      });
}

// What a node does to a Gaussian: from the field's outputs, its place and the Gaussian's.
double node_text() {
  const HexplaneGrid grid{3, 3, {.3f, -.2f, .1f}, {.5f, 1.5f, 2.f}};
  const NodeBlend v{kMean, {.3, -.1, .8, .5}};
  const auto row_of = [&](const std::vector<double>& x) {
    std::vector<double> row(NODE_ROW);
    node_row(node_pose(three(x, 7), grid, x.data()), node_centre(grid), row.data());
    return row;
  };
  return text_error(
      13,
      [&](const std::vector<double>& x) {
        std::vector<double> v_outputs(7), v_row(NODE_ROW);
        node_blend_vjp(three(x, 10) - node_centre(grid), v, v_row.data());
        const real3 v_mean = node_blend_vjp_place(row_of(x).data(), v.shift);
        real4 v_unit;
        real3 v_shift, v_place;
        node_row_vjp(node_pose(three(x, 7), grid, x.data()), node_centre(grid), v_row.data(),
                     &v_unit, &v_shift, &v_place);
        node_pose_vjp(grid, x.data(), v_unit, v_shift, v_outputs.data());
        std::vector<double> all = v_outputs;
        for (const real3& part : {v_place, v_mean}) all.insert(all.end(), {part.x, part.y, part.z});
        return all;
      },
      [&](const std::vector<double>& x) {
        const NodeBlend b = node_blend(row_of(x).data(), three(x, 10) - node_centre(grid));
        return dot(b.shift, v.shift) + dot(b.turn, v.turn);
      });
}

MotionShape shape_of(MotionModelKind kind) {
  TrainOptions options;
  for (const char* setting : {"nodes.count=4", "nodes.rigidity=0"}) apply_setting(options, setting);
  MotionShape shape = motion_shape(kind, options.motion, 5);
  shape.duration = 2;
  shape.keys = 5;
  shape.key_scales = kind == MotionModelKind::keyframes;
  shape.bases = 3;
  shape.hexplane.levels = 2;
  shape.hexplane.layers = 2;
  shape.hexplane.times = 3;
  shape.hexplane.resolution = 3;
  shape.hexplane.hidden = 32;
  shape.hexplane.centre = {0.1f, -0.2f, 0.f};
  shape.hexplane.half_size = {1.f, 1.5f, 0.75f};
  return shape;
}

// The reference's derivative of the hexplane field by planes and network.
double hexplane_text() {
  const MotionShape shape = shape_of(MotionModelKind::hexplane);
  size_t planes = 0, network = 0;
  for (const TableSpec& table : motion_tables(shape))
    for (const GroupSpec& group : table.groups)
      (group.name == "planes" ? planes : network) += table.count(0) * group.width;
  Random random(54);
  Named p;
  for (size_t i = 0; i < planes; ++i) p["planes"].push_back(1 + .2 * random.uniform(-1, 1));
  for (size_t i = 0; i < network; ++i) p["network"].push_back(.15 * random.uniform(-1, 1));
  const Shift v{kMean, {.3, -.1, .8, .5}, {.2, -.4, .6}};
  const real3 mean{.2, .5, -.3};
  const reference::HexplaneGradient g = reference::hexplane_vjp(shape.hexplane, 2, p, mean, .7, v);
  double most = 0;
  for (const auto& [name, gradient] : {std::pair{"planes", &g.planes}, {"network", &g.network}}) {
    Named moved = p;
    const auto loss = [&, key = std::string(name)](const std::vector<double>& x) {
      moved[key] = x;
      const Shift d = reference::hexplane_shift(shape.hexplane, 2, moved, mean, .7);
      return dot(d.mean, v.mean) + dot(d.quat, v.quat) + dot(d.log_scales, v.log_scales);
    };
    const std::vector<size_t> some = spread_indices(gradient->size(), 300);
    most = worse(most, relative_error(picked(*gradient, some), slopes(loss, p[name], 1e-4, some)));
  }
  return most;
}

// Regularisation of the planes. The cost is quadratic except for |p - 1|, so differences are exact
// and serve as the reference; the last column compares two step sizes.
Derivative plane_rule_row(Queue& queue) {
  const MotionShape shape = shape_of(MotionModelKind::hexplane);
  MotionOptions options;
  HexplaneOptions& rule = options.hexplane;
  rule.plane_tv = .1f;
  rule.time_smoothness = .2f;
  rule.l1_time = .3f;
  const std::unique_ptr<Motion> motion = make_motion(queue, shape);
  Parameters p(queue, kCount, motion->groups(), motion->tables());
  Random random(57);
  std::vector<double> x;
  for (size_t i = 0; i < p["planes"].values.size(); ++i)
    x.push_back(double(float(1 + (i % 2 ? .2 : -.2) * random.uniform(.1, 1))));
  p["planes"].values.write(queue, std::vector<float>(x.begin(), x.end()));
  p.forget_seen(queue);
  motion->regularize(queue, p, options);
  const auto cost = [&](const std::vector<double>& y) {
    return reference::plane_cost(shape.hexplane, rule, y);
  };
  const std::vector<size_t> some = spread_indices(x.size(), 300);
  const std::vector<double> expected = slopes(cost, x, 1e-3, some);
  return {"hexplane_regularize",
          "planes",
          relative_error(picked(p["planes"].grads.read(queue), some), expected),
          relative_error(expected, slopes(cost, x, 1e-2, some)),
          1e-4,
          1e-6};
}

}  // namespace

std::vector<Derivative> motion_derivatives(Queue& queue) {
  std::vector<Derivative> rows;
  const std::pair<MotionModelKind, double (*)()> texts[] = {
      {MotionModelKind::spacetime, spacetime_text}, {MotionModelKind::native4d, native4d_text},
      {MotionModelKind::keyframes, shifted_text},   {MotionModelKind::bases, basis_text},
      {MotionModelKind::hexplane, hexplane_text},   {MotionModelKind::nodes, node_text}};
  for (const auto& [kind, text] : texts) {
    std::string groups;
    const double to_double = device_error(queue, shape_of(kind), groups);
    rows.push_back({name_of(kind), groups, to_double, text(), 1e-4, 1e-6});
  }
  rows.push_back(plane_rule_row(queue));
  return rows;
}

}  // namespace gflow::stress
