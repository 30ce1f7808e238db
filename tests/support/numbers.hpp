// SPDX-License-Identifier: Apache-2.0
// Constants of many tests.
#pragma once
#include <cmath>
#include <limits>

#include "tests/support/compare.hpp"

constexpr float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
constexpr float INFINITE = std::numeric_limits<float>::infinity();

inline double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// Tolerance of float32: about 100 roundings of values between 1 and 10.
constexpr Tolerance FLOAT_MATHS{1e-5, 1e-5};
