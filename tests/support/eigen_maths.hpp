// SPDX-License-Identifier: Apache-2.0
// Converts the small vectors of kernels/shared to Eigen, which serves as reference.
#pragma once
#include <Eigen/Dense>
#include <random>

#include "shared/motion/native4d.h"
#include "shared/transport.h"

namespace gflow {

inline Eigen::Vector2d eigen(real2 v) { return {v.x, v.y}; }
inline Eigen::Vector3d eigen(real3 v) { return {v.x, v.y, v.z}; }
inline Eigen::Vector4d eigen(real4 v) { return {v.x, v.y, v.z, v.w}; }
inline Eigen::Matrix2d eigen(Mat2 m) {
  Eigen::Matrix2d e;
  e << m.a, m.b, m.c, m.d;
  return e;
}
inline Eigen::Matrix2d eigen(Sym2 m) { return eigen(mat2_of(m)); }
inline Eigen::Matrix<double, 2, 3> eigen(Mat23 m) {
  Eigen::Matrix<double, 2, 3> e;
  e << eigen(m.r1).transpose(), eigen(m.r2).transpose();
  return e;
}
inline Eigen::Matrix3d eigen(Mat3 m) {
  Eigen::Matrix3d e;
  e << eigen(m.r1).transpose(), eigen(m.r2).transpose(), eigen(m.r3).transpose();
  return e;
}
inline Mat23 mat23_from(const Eigen::Matrix<double, 2, 3>& e) {
  return make_mat23({e(0, 0), e(0, 1), e(0, 2)}, {e(1, 0), e(1, 1), e(1, 2)});
}
// Eigen also uses Hamilton's product; its constructor takes w x y z as gflow does.
inline Eigen::Quaterniond eigen_quat(real4 q) { return {q.x, q.y, q.z, q.w}; }

// Symmetric positive roots by eigenvectors, unlike in the kernels.
inline Eigen::Matrix2d eigen_sqrt(const Eigen::Matrix2d& s) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(s).operatorSqrt();
}
inline Eigen::Matrix2d eigen_inverse_sqrt(const Eigen::Matrix2d& s) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(s).operatorInverseSqrt();
}

// Uniform in [-1, 1].
class Random {
 public:
  explicit Random(unsigned seed) : rng_(seed) {}
  double operator()() { return double(rng_()) / 2147483647.5 - 1; }
  real2 two() { return {(*this)(), (*this)()}; }
  real3 three() { return {(*this)(), (*this)(), (*this)()}; }
  real4 four() { return {(*this)(), (*this)(), (*this)(), (*this)()}; }
  Mat3 nine() { return {three(), three(), three()}; }

 private:
  std::mt19937 rng_;
};

}  // namespace gflow
