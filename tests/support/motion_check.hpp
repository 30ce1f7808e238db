// SPDX-License-Identifier: Apache-2.0
// Checks every motion model against its forward pass in double: the device gives the same
// Gaussians, and its gradients at two times equal central differences.
#pragma once
#include <map>
#include <set>

#include "optim/motion/models.hpp"
#include "optim/reference/device_scene.hpp"
#include "optim/reference/motion_models.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/eigen_maths.hpp"

namespace gflow {

// All parameters in double, by group.
using Named = reference::Named;
using reference::DoubleForward;

class MotionCheck {
 public:
  // Normal random parameters for n Gaussians with standard deviation `spread`, or that of the
  // group. Those from row `moving` on are static: of a model without motion rows of Gaussians.
  MotionCheck(Queue& queue, const MotionShape& shape, size_t n, DoubleForward forward,
              const std::map<std::string, double>& spreads = {}, double spread = 0.5,
              size_t moving = Parameters::all)
      : queue_(queue),
        n_(n),
        forward_([=](const Named& p, size_t i, double t) {
          if (i < moving) return forward(p, i, t);
          return shifted_at(reference::canonical_row(p, i), {{0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}},
                            t);
        }),
        motion_(make_motion(queue, shape)),
        p_(queue, n, motion_->groups(), motion_->tables(), moving) {
    Random random(17);
    for (Table* table : p_.tables())
      for (ParameterGroup& group : table->groups) {
        const std::string& name = group.values.name();
        const double deviation = spreads.count(name) ? spreads.at(name) : spread;
        std::vector<float> floats;
        for (size_t k = 0; k < group.values.size(); ++k)
          floats.push_back(float(deviation * random()));
        if (name == "quats")
          for (size_t i = 0; i < n; ++i) floats[4 * i] += 1;  // avoids near-zero length
        group.values.write(queue, floats);
        values_[name] = std::vector<double>(floats.begin(), floats.end());
      }
    p_.forget_seen(queue);
  }

  Parameters& parameters() { return p_; }
  Motion& motion() { return *motion_; }
  Named& values() { return values_; }

  // Compares the device at time t with the double forward pass.
  void expect_same_gaussians(double t, Tolerance tolerance) {
    GaussiansAt at;
    const Buffer<cl_uint> all(queue_, std::vector<cl_uint>(n_, 1u), "seen");
    motion_->at(queue_, p_, float(t), &all, at);
    std::vector<double> means, factors, opacities;
    for (size_t i = 0; i < n_; ++i) {
      const Shifted o = forward_(values_, i, float(t));
      for (double x : {o.mean.x, o.mean.y, o.mean.z}) means.push_back(x);
      for (real3 r : {o.factor.r1, o.factor.r2, o.factor.r3})
        for (double x : {r.x, r.y, r.z}) factors.push_back(x);
      opacities.push_back(o.life.opacity);
    }
    EXPECT_TRUE(all_close(at.means.read(queue_), means, tolerance));
    EXPECT_TRUE(all_close(at.factors.read(queue_), factors, tolerance));
    EXPECT_TRUE(all_close(at.opacities.read(queue_), opacities, tolerance));
  }

  // Compares gradients of random weights of the Gaussians seen at t1 and t2 (no opacity at t2;
  // every third Gaussian unseen) with differences, by relative L2 per group. Runs twice to detect
  // gradients left from the first time. Groups in `fixed` are not trained.
  void expect_same_gradients(double t1, double t2, double bound,
                             const std::set<std::string>& fixed = {}) {
    for (int round = 0; round < 2; ++round) gradients_once(t1, t2, bound, 30 + round, fixed);
  }

 private:
  void gradients_once(double t1, double t2, double bound, int seed,
                      const std::set<std::string>& fixed) {
    Random random(seed);
    const auto numbers = [&](size_t size) {
      std::vector<double> v(size);
      for (double& x : v) x = float(random());
      return v;
    };
    const std::vector<double> m1 = numbers(3 * n_), m2 = numbers(3 * n_), f1 = numbers(9 * n_);
    const std::vector<double> f2 = numbers(9 * n_), o1 = numbers(n_);
    std::vector<cl_uint> touched;
    for (size_t i = 0; i < n_; ++i) touched.push_back(i % 3 == 2 ? 0 : 2);
    const auto weighed = [&](const Shifted& o, size_t i, const std::vector<double>& m,
                             const std::vector<double>& f) {
      const Mat3 v = reference::rows9(f, i);
      return dot(o.mean, reference::row3(m, i)) + dot(o.factor.r1, v.r1) + dot(o.factor.r2, v.r2) +
             dot(o.factor.r3, v.r3);
    };
    const auto loss = [&](const Named& p, size_t first, size_t end) {
      double sum = 0;
      for (size_t i = first; i < end; ++i) {
        if (!touched[i]) continue;
        const Shifted a = forward_(p, i, float(t1)), b = forward_(p, i, float(t2));
        sum += weighed(a, i, m1, f1) + weighed(b, i, m2, f2) + a.life.opacity * o1[i];
      }
      return sum;
    };

    p_.forget_seen(queue_);
    const Buffer<cl_uint> seen(queue_, touched, "tiles_touched");
    const auto upload = [&](const std::vector<double>& v) {
      return Buffer<float>(queue_, to_float(v), "v");
    };
    const Buffer<float> opacity = upload(o1);
    GaussiansAt at;
    motion_->at(queue_, p_, float(t1), nullptr, at);
    motion_->backward(queue_, p_, float(t1), true, seen, upload(m1), upload(f1), opacity);
    motion_->backward(queue_, p_, float(t2), false, seen, upload(m2), upload(f2), opacity);

    const std::vector<const Table*> tables = std::as_const(p_).tables();
    for (size_t which = 0; which < tables.size(); ++which) {
      const Table* const table = tables[which];
      const bool shared = which > 0 && p_.more_specs[which - 1].rows > 0;
      const std::vector<cl_uint> rows = table->rows.seen.read(queue_);
      for (const ParameterGroup& group : table->groups) {
        const std::string& name = group.values.name();
        if (fixed.count(name)) continue;
        // A parameter of one Gaussian (row k n + i belongs to Gaussian i) affects its own loss
        // only.
        Named p = values_;
        std::vector<double> expected;
        for (size_t k = 0; k < p[name].size(); ++k) {
          const size_t i = k / group.width % n_;
          const auto loss_at = [&](double x) {
            p[name][k] = x;
            return shared ? loss(p, 0, n_) : loss(p, i, i + 1);
          };
          const double x = p[name][k], h = 1e-5;
          expected.push_back((loss_at(x + h) - loss_at(x - h)) / (2 * h));
          p[name][k] = x;
        }
        // A row that was not seen has no gradient.
        std::vector<float> found = group.grads.read(queue_);
        for (size_t k = 0; k < found.size(); ++k) {
          const size_t row = k / group.width;
          const bool active =
              row >= table->active.first && row < table->active.first + table->active.count;
          EXPECT_TRUE(active || !rows[row]) << name;
          if (!rows[row]) found[k] = 0;
        }
        EXPECT_LT(relative_l2(found, expected), bound) << name;
        EXPECT_GT(norm(expected), 0) << name;
      }
    }
  }

  Queue& queue_;
  size_t n_;
  DoubleForward forward_;
  std::unique_ptr<Motion> motion_;
  Parameters p_;
  Named values_;
};

}  // namespace gflow
