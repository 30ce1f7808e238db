// SPDX-License-Identifier: Apache-2.0
// The native4d motion model: a 4D Gaussian, sliced at time t (RT-4DGS, Yang et al. 2023; used in
// the paper's novel-view experiment). Its 4x4 factor is P = R diag(s) with the 4D rotation
// R v = ql v conj(qr), where v = (x, y, z, t) is read as the quaternion t + xi + yj + zk; ql = qr
// rotates space alone. With p_t the time row of P, P_space its other rows and u = p_t/|p_t|, the
// slice is given by
//   mean      mu + velocity (t - mu_t),  velocity = P_space p_t / |p_t|^2
//   factor    L = first three columns of P_space H, H the reflection that takes u to the t axis:
//             L L^T is exactly the Schur complement, and L does not depend on t
//   opacity   sigmoid(logit) exp(-(t - mu_t)^2 / (2 |p_t|^2))
#ifndef GFLOW_NATIVE4D_H
#define GFLOW_NATIVE4D_H
#include "shared/motion/life.h"
#include "shared/quat.h"

// One Gaussian's parameters, as optimised.
typedef struct Native4d {
  real3 mean;
  real mean_t;
  real4 quat, quat_r;       // ql and qr, not normalised
  real4 log_scales;         // x y z t
  real logit_opacity;
} Native4d;

typedef struct Rows4 {
  real4 x, y, z, t;  // rows of P, each over the columns x y z t
} Rows4;

// R e_k for the four axes, as quaternions (.x is the t component).
typedef struct Frame4 {
  real4 x, y, z, t;
} Frame4;
static inline Frame4 frame4(real4 ql, real4 qr) {
  const real o = 0, i = 1;
  const real4 r = quat_conj(qr);
  Frame4 f;
  f.x = quat_mul(quat_mul(ql, make_real4(o, i, o, o)), r);
  f.y = quat_mul(quat_mul(ql, make_real4(o, o, i, o)), r);
  f.z = quat_mul(quat_mul(ql, make_real4(o, o, o, i)), r);
  f.t = quat_mul(ql, r);
  return f;
}
// Gradient with respect to ql and qr (both unit), given that with respect to the frame.
typedef struct Frame4Gradient {
  real4 ql, qr;
} Frame4Gradient;
static inline Frame4Gradient frame4_vjp(real4 ql, real4 qr, Frame4 v) {
  const real o = 0, i = 1;
  const real4 ex = make_real4(o, i, o, o), ey = make_real4(o, o, i, o), ez = make_real4(o, o, o, i);
  Frame4Gradient g;
  // y = a b: v_a = v_y conj(b), v_b = conj(a) v_y
  g.ql = quat_mul(v.x, quat_mul(qr, quat_conj(ex))) + quat_mul(v.y, quat_mul(qr, quat_conj(ey))) +
         quat_mul(v.z, quat_mul(qr, quat_conj(ez))) + quat_mul(v.t, qr);
  g.qr = quat_conj(quat_mul(quat_conj(quat_mul(ql, ex)), v.x) +
                   quat_mul(quat_conj(quat_mul(ql, ey)), v.y) +
                   quat_mul(quat_conj(quat_mul(ql, ez)), v.z) + quat_mul(quat_conj(ql), v.t));
  return g;
}

static inline Rows4 rows_of(Frame4 f, real4 s) {
  Rows4 p;
  p.t = make_real4(f.x.x * s.x, f.y.x * s.y, f.z.x * s.z, f.t.x * s.w);
  p.x = make_real4(f.x.y * s.x, f.y.y * s.y, f.z.y * s.z, f.t.y * s.w);
  p.y = make_real4(f.x.z * s.x, f.y.z * s.y, f.z.z * s.z, f.t.z * s.w);
  p.z = make_real4(f.x.w * s.x, f.y.w * s.y, f.z.w * s.z, f.t.w * s.w);
  return p;
}

// The slice at one time.
typedef struct Slice {
  real3 mean;
  Mat3 factor;
  Life life;
  // intermediate values for the derivative
  real dt, var_t, norm_t;  // t - mu_t, |p_t|^2, |p_t|
  real3 velocity;
  real4 u;
  real sign, beta;  // of the reflection: sign(u_t), 1/(1 + |u_t|)
  real3 d;          // P_r . (u + sign e_t) for the three space rows
} Slice;

static inline real3 reflected_row(real4 row, real d, real4 u, real beta) {
  const real f = d * beta;
  return make_real3(row.x - f * u.x, row.y - f * u.y, row.z - f * u.z);
}

static inline Slice slice_rows(Native4d g, Rows4 p, real t) {
  Slice o;
  o.var_t = dot(p.t, p.t);
  o.norm_t = sqrt(o.var_t);
  o.dt = t - g.mean_t;
  o.life = life_at(g.logit_opacity, o.dt, o.var_t);
  const real inv_var = (real)1 / o.var_t;
  o.velocity = make_real3(dot(p.x, p.t), dot(p.y, p.t), dot(p.z, p.t)) * inv_var;
  o.mean = g.mean + o.velocity * o.dt;
  o.u = p.t * ((real)1 / o.norm_t);
  o.sign = o.u.w < (real)0 ? (real)-1 : (real)1;
  o.beta = (real)1 / ((real)1 + fabs(o.u.w));
  o.d = make_real3(dot(p.x, o.u) + o.sign * p.x.w, dot(p.y, o.u) + o.sign * p.y.w,
                   dot(p.z, o.u) + o.sign * p.z.w);
  o.factor.r1 = reflected_row(p.x, o.d.x, o.u, o.beta);
  o.factor.r2 = reflected_row(p.y, o.d.y, o.u, o.beta);
  o.factor.r3 = reflected_row(p.z, o.d.z, o.u, o.beta);
  return o;
}

// exp(-(t - mu_t)^2 / (2 |p_t|^2)) alone: the cheap test of the time window.
static inline real marginal_at(Native4d g, real t) {
  const Frame4 f = frame4(quat_normalize(g.quat).q, quat_normalize(g.quat_r).q);
  const real4 s = exp(g.log_scales);
  const real4 p_t = make_real4(f.x.x * s.x, f.y.x * s.y, f.z.x * s.z, f.t.x * s.w);
  const real dt = t - g.mean_t;
  return exp((real)-0.5f * dt * dt / dot(p_t, p_t));
}

static inline Slice slice_at(Native4d g, real t) {
  const Frame4 f = frame4(quat_normalize(g.quat).q, quat_normalize(g.quat_r).q);
  return slice_rows(g, rows_of(f, exp(g.log_scales)), t);
}

// Gradient with respect to one space row of P, given that row's v_l, v_d and v_velocity.
static inline real4 row_vjp(Slice o, real3 v_l, real v_d, real v_velocity, real4 p_t) {
  real4 g = make_real4(v_l.x, v_l.y, v_l.z, v_d * o.sign) + o.u * v_d;
  return g + p_t * (v_velocity / o.var_t);
}

// Gradient with respect to the parameters, given that with respect to mean, factor and opacity.
static inline Native4d slice_vjp(Native4d g, real t, real3 v_mean, Mat3 v_l, real v_opacity) {
  const UnitQuat ql = quat_normalize(g.quat), qr = quat_normalize(g.quat_r);
  const Frame4 f = frame4(ql.q, qr.q);
  const real4 s = exp(g.log_scales);
  const Rows4 p = rows_of(f, s);
  const Slice o = slice_rows(g, p, t);
  Native4d v;

  const LifeGradient life = life_vjp(o.life, g.logit_opacity, o.dt, o.var_t, v_opacity);
  v.logit_opacity = life.logit;
  v.mean = v_mean;
  v.mean_t = -(life.dt + dot(v_mean, o.velocity));
  const real3 v_velocity = v_mean * o.dt;
  const real v_var = life.var - dot(v_velocity, o.velocity) / o.var_t;

  // factor rows: l = p - beta d u (space part)
  const real3 u3 = make_real3(o.u.x, o.u.y, o.u.z);
  const real3 lu = make_real3(dot(v_l.r1, u3), dot(v_l.r2, u3), dot(v_l.r3, u3));
  const real3 v_d = lu * -o.beta;
  const real3 v_u3 = (v_l.r1 * o.d.x + v_l.r2 * o.d.y + v_l.r3 * o.d.z) * -o.beta;
  const real v_beta = -dot(lu, o.d);
  real4 v_u = make_real4(v_u3.x, v_u3.y, v_u3.z, -o.beta * o.beta * o.sign * v_beta);
  v_u = v_u + p.x * v_d.x + p.y * v_d.y + p.z * v_d.z;

  Rows4 v_p;
  v_p.x = row_vjp(o, v_l.r1, v_d.x, v_velocity.x, p.t);
  v_p.y = row_vjp(o, v_l.r2, v_d.y, v_velocity.y, p.t);
  v_p.z = row_vjp(o, v_l.r3, v_d.z, v_velocity.z, p.t);
  v_p.t = (v_u - o.u * dot(o.u, v_u)) * ((real)1 / o.norm_t) + p.t * ((real)2 * v_var) +
          (p.x * v_velocity.x + p.y * v_velocity.y + p.z * v_velocity.z) * ((real)1 / o.var_t);

  // columns of P are s_k R e_k
  const real4 cx = make_real4(v_p.t.x, v_p.x.x, v_p.y.x, v_p.z.x);
  const real4 cy = make_real4(v_p.t.y, v_p.x.y, v_p.y.y, v_p.z.y);
  const real4 cz = make_real4(v_p.t.z, v_p.x.z, v_p.y.z, v_p.z.z);
  const real4 ct = make_real4(v_p.t.w, v_p.x.w, v_p.y.w, v_p.z.w);
  v.log_scales = make_real4(s.x * dot(cx, f.x), s.y * dot(cy, f.y), s.z * dot(cz, f.z),
                            s.w * dot(ct, f.t));
  Frame4 v_f;
  v_f.x = cx * s.x;
  v_f.y = cy * s.y;
  v_f.z = cz * s.z;
  v_f.t = ct * s.w;
  const Frame4Gradient v_q = frame4_vjp(ql.q, qr.q, v_f);
  v.quat = quat_normalize_vjp(ql, v_q.ql);
  v.quat_r = quat_normalize_vjp(qr, v_q.qr);
  return v;
}

#endif
