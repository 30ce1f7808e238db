// SPDX-License-Identifier: Apache-2.0
// The bounds are those of OpenCL 1.2 (section 7.4, table of ULP values, full profile); that of
// determinants is from `gflow stress`, T5.
#include "optim/engine/self_check.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "optim/engine/exact_covariance.hpp"
#include "runtime/primitives/sort.hpp"

namespace gflow {
namespace {

// Largest error of `actual`, in units in the last place of the expected float.
double worst_ulp(const std::vector<float>& actual, const std::function<double(size_t)>& expected) {
  double worst = 0;
  for (size_t i = 0; i < actual.size(); ++i) {
    const double exact = expected(i);
    const double ulp = std::ldexp(1.0, std::max(std::ilogb(exact), -126) - 23);
    const double error = std::fabs(actual[i] - exact) / ulp;
    if (!(error <= worst)) worst = error;
    if (std::isnan(worst)) return worst;
  }
  return worst;
}

// Factors of long, thin splats of 1e-2 to 1e4 px, some a thousandth as wide: a c - b b of their
// covariances has no correct digit.
std::vector<float> needles(std::mt19937& rng, size_t n) {
  std::uniform_real_distribution<float> direction(-1, 1), length(-2, 4), width(-3, 0);
  std::vector<float> factors(6 * n);
  for (size_t i = 0; i < n; ++i) {
    const float scale = std::pow(10.f, length(rng)), share = std::pow(10.f, width(rng));
    const float across = direction(rng), along = direction(rng);
    for (size_t k = 0; k < 3; ++k) {
      const float axis = scale * direction(rng);
      factors[6 * i + k] = axis * along + share * scale * direction(rng);
      factors[6 * i + 3 + k] = axis * across + share * scale * direction(rng);
    }
  }
  return factors;
}

double worst_determinant(const std::vector<float>& found, const std::vector<float>& factors) {
  double worst = 0;
  for (size_t i = 0; i < found.size(); ++i) {
    const double exact = ExactCovariance(&factors[6 * i]).det();
    const double error = std::fabs(double(found[i]) / exact - 1);
    if (!(error <= worst)) worst = error;
    if (std::isnan(worst)) return worst;
  }
  return worst;
}

void check_maths(Queue& queue, const Program& program, SelfCheck& rows) {
  const size_t n = 4096;
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> exponent(-125, 125), half(-60, 60);
  std::vector<float> exponents(n), positives(n), divisors(n);
  for (size_t i = 0; i < n; ++i) {
    exponents[i] = exponent(rng);
    positives[i] = std::exp2(half(rng));
    divisors[i] = std::exp2(half(rng));
  }
  Buffer<float> x(queue, exponents, "exponents"), p(queue, positives, "positives"),
      d(queue, divisors, "divisors");
  const std::vector<float> factors = needles(rng, n);
  Buffer<float> f(queue, factors, "factors"), determinants(queue, n, "determinants");
  Buffer<float> e(queue, n, "exp2s"), s(queue, n, "square roots"), q(queue, n, "quotients");
  Kernel<cl_uint, In<float>, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>,
         Out<float>>
      check(program, "check_maths");
  check(queue, Range::over(n), cl_uint(n), x, p, d, f, e, s, q, determinants);
  rows.push_back(self_check_row(
      "float32 exp2, error in ulp",
      worst_ulp(e.read(queue), [&](size_t i) { return std::exp2(double(exponents[i])); }), 3));
  rows.push_back(self_check_row(
      "float32 sqrt, error in ulp",
      worst_ulp(s.read(queue), [&](size_t i) { return std::sqrt(double(positives[i])); }), 3));
  rows.push_back(self_check_row(
      "float32 division, error in ulp",
      worst_ulp(q.read(queue), [&](size_t i) { return double(positives[i]) / divisors[i]; }), 2.5));
  rows.push_back(self_check_row("determinants of thin splats, relative",
                                worst_determinant(determinants.read(queue), factors), 5e-7));
}

void check_nan_tests(Queue& queue, const Program& program, SelfCheck& rows) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<float> values = {1, -1, 0, 3e38f, -3e38f, 1e-38f, nan, -nan, inf, -inf};
  // bits: 1 finite, 2 differs from itself, 4 fails "is positive"
  const std::vector<cl_uint> expected = {1, 5, 5, 1, 5, 1, 6, 6, 0, 4};
  Buffer<float> in(queue, values, "NaN test values");
  Buffer<cl_uint> out(queue, values.size(), "NaN test flags");
  Kernel<cl_uint, In<float>, Out<cl_uint>> check(program, "check_nan_tests");
  check(queue, Range::over(values.size()), cl_uint(values.size()), in, out);
  const auto flags = out.read(queue);
  size_t wrong = 0;
  for (size_t i = 0; i < flags.size(); ++i) wrong += flags[i] != expected[i];
  rows.push_back(self_check_row("NaN and infinity tests, wrong answers", double(wrong), 0));
}

void check_sort(Queue& queue, SelfCheck& rows) {
  const size_t n = 10000;
  std::mt19937 rng(2);
  std::vector<cl_uint> keys(n), values(n);
  for (size_t i = 0; i < n; ++i) {
    keys[i] = (rng() % 50) * 0x01234567u;  // many ties, all digits in use
    values[i] = cl_uint(i);
  }
  Buffer<cl_uint> key_buffer(queue, keys, "sort check keys");
  Buffer<cl_uint> value_buffer(queue, values, "sort check values");
  RadixSort(queue).sort(queue, key_buffer, value_buffer, n);
  const auto sorted = key_buffer.read(queue), from = value_buffer.read(queue);
  size_t wrong = 0;
  for (size_t i = 0; i < n; ++i) {
    const bool intact = from[i] < n && keys[from[i]] == sorted[i];
    const bool ordered = i == 0 || sorted[i - 1] < sorted[i] ||
                         (sorted[i - 1] == sorted[i] && from[i - 1] < from[i]);
    wrong += !intact || !ordered;
  }
  rows.push_back(self_check_row("stable sort, misplaced of 10000 pairs", double(wrong), 0));
}

}  // namespace

SelfCheckRow self_check_row(const std::string& name, double value, double bound) {
  return {name, value, bound, value <= bound};
}

SelfCheck self_check(Queue& queue) {
  SelfCheck rows;
  const Program program(queue, "common.cl");
  check_maths(queue, program, rows);
  check_nan_tests(queue, program, rows);
  check_sort(queue, rows);
  return rows;
}

}  // namespace gflow
