// SPDX-License-Identifier: Apache-2.0
// The small matrices of splat maths, each a struct of its rows.
#ifndef GFLOW_LINEAR_H
#define GFLOW_LINEAR_H
#include "shared/dialect.h"

typedef struct Mat2 {
  real a, b, c, d;  // [[a, b], [c, d]]
} Mat2;

typedef struct Sym2 {
  real a, b, c;  // [[a, b], [b, c]]
} Sym2;

typedef struct Mat23 {
  real3 r1, r2;
} Mat23;

typedef struct Mat3 {
  real3 r1, r2, r3;
} Mat3;

static inline Mat2 make_mat2(real a, real b, real c, real d) {
  Mat2 m;
  m.a = a;
  m.b = b;
  m.c = c;
  m.d = d;
  return m;
}
static inline Sym2 make_sym2(real a, real b, real c) {
  Sym2 s;
  s.a = a;
  s.b = b;
  s.c = c;
  return s;
}
static inline Mat23 make_mat23(real3 r1, real3 r2) {
  Mat23 m;
  m.r1 = r1;
  m.r2 = r2;
  return m;
}

static inline Mat2 mat2_mul(Mat2 x, Mat2 y) {
  return make_mat2(x.a * y.a + x.b * y.c, x.a * y.b + x.b * y.d,  //
                   x.c * y.a + x.d * y.c, x.c * y.b + x.d * y.d);
}
static inline Mat2 mat2_transpose(Mat2 x) { return make_mat2(x.a, x.c, x.b, x.d); }
static inline Mat2 mat2_of(Sym2 s) { return make_mat2(s.a, s.b, s.b, s.c); }
static inline Sym2 mat2_sym(Mat2 x) { return make_sym2(x.a, (real)0.5f * (x.b + x.c), x.d); }
static inline Sym2 sym2_add(Sym2 x, Sym2 y) { return make_sym2(x.a + y.a, x.b + y.b, x.c + y.c); }
static inline Sym2 sym2_scale(Sym2 x, real s) { return make_sym2(x.a * s, x.b * s, x.c * s); }
static inline Sym2 sym2_adj(Sym2 x) { return make_sym2(x.c, -x.b, x.a); }
static inline real sym2_trace(Sym2 x) { return x.a + x.c; }
// tr(X Y)
static inline real sym2_inner(Sym2 x, Sym2 y) {
  return x.a * y.a + (real)2 * x.b * y.b + x.c * y.c;
}
// a b - c d and a b + c d to 1.5 ulp, whatever cancels (Kahan; Jeannerod, Louvet, Muller 2013).
static inline real difference_of_products(real a, real b, real c, real d) {
  const real cd = c * d, lost = fma(-c, d, cd);
  return fma(a, b, -cd) + lost;
}
static inline real sum_of_products(real a, real b, real c, real d) {
  return difference_of_products(a, b, -c, d);
}
// A Q A^T for a 2x2 A and a symmetric Q.
static inline Sym2 sym2_congruence(Mat2 m, Sym2 q) {
  const real pa = sum_of_products(m.a, q.a, m.b, q.b), pb = sum_of_products(m.a, q.b, m.b, q.c);
  const real pc = sum_of_products(m.c, q.a, m.d, q.b), pd = sum_of_products(m.c, q.b, m.d, q.c);
  return make_sym2(sum_of_products(pa, m.a, pb, m.b), sum_of_products(pa, m.c, pb, m.d),
                   sum_of_products(pc, m.c, pd, m.d));
}
// (2x2) (2x3)
static inline Mat23 mat23_left(Mat2 x, Mat23 m) {
  return make_mat23(x.a * m.r1 + x.b * m.r2, x.c * m.r1 + x.d * m.r2);
}
// (2x3) (2x3)^T
static inline Mat2 mat23_outer(Mat23 x, Mat23 y) {
  return make_mat2(dot(x.r1, y.r1), dot(x.r1, y.r2), dot(x.r2, y.r1), dot(x.r2, y.r2));
}
static inline Mat23 mat23_sub(Mat23 x, Mat23 y) { return make_mat23(x.r1 - y.r1, x.r2 - y.r2); }
static inline Mat23 mat23_add(Mat23 x, Mat23 y) { return make_mat23(x.r1 + y.r1, x.r2 + y.r2); }

// The cross product, each component to 1.5 ulp: for nearly parallel vectors.
static inline real3 cross_exactly(real3 x, real3 y) {
  return make_real3(difference_of_products(x.y, y.z, x.z, y.y),
                    difference_of_products(x.z, y.x, x.x, y.z),
                    difference_of_products(x.x, y.y, x.y, y.x));
}

static inline real3 mat3_mul_vec(Mat3 a, real3 x) {
  return make_real3(dot(a.r1, x), dot(a.r2, x), dot(a.r3, x));
}
static inline real3 mat3_transpose_mul_vec(Mat3 a, real3 x) {
  return a.r1 * x.x + a.r2 * x.y + a.r3 * x.z;
}
static inline Mat3 mat3_transpose(Mat3 a) {
  Mat3 t;
  t.r1 = make_real3(a.r1.x, a.r2.x, a.r3.x);
  t.r2 = make_real3(a.r1.y, a.r2.y, a.r3.y);
  t.r3 = make_real3(a.r1.z, a.r2.z, a.r3.z);
  return t;
}
static inline Mat3 mat3_mul(Mat3 a, Mat3 b) {
  Mat3 c;
  c.r1 = mat3_transpose_mul_vec(b, a.r1);
  c.r2 = mat3_transpose_mul_vec(b, a.r2);
  c.r3 = mat3_transpose_mul_vec(b, a.r3);
  return c;
}
static inline Mat3 mat3_add(Mat3 a, Mat3 b) {
  Mat3 c;
  c.r1 = a.r1 + b.r1;
  c.r2 = a.r2 + b.r2;
  c.r3 = a.r3 + b.r3;
  return c;
}
static inline Mat3 mat3_scale(Mat3 a, real s) {
  Mat3 c;
  c.r1 = a.r1 * s;
  c.r2 = a.r2 * s;
  c.r3 = a.r3 * s;
  return c;
}
static inline Mat3 mat3_identity(void) {
  const real o = 0, i = 1;
  Mat3 e;
  e.r1 = make_real3(i, o, o);
  e.r2 = make_real3(o, i, o);
  e.r3 = make_real3(o, o, i);
  return e;
}

#endif
