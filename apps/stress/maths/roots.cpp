// SPDX-License-Identifier: Apache-2.0
// T1-T4: square roots of covariances and A = B2 inv(B1) with its gradient, for condition numbers
// kappa from 1 to 1e8 and sizes from tiny to huge. Double against eigenvectors in long double,
// device against double.
#include "apps/stress/device_maths.hpp"
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"

namespace gflow::stress {
namespace {

using longer = long double;

// A covariance with eigenvalues `size` and `size` / kappa after rounding to T, and its determinant
// as exact as T holds it.
template <class T>
struct Covariance {
  T a, b, c, det;
};

template <class T>
T exact_det(T a, T b, T c) {  // Kahan's difference of products: 1.5 ulp
  const T p = b * b, e = std::fma(-b, b, p);
  return std::fma(a, c, -p) + e;
}

// `rounded` is true if kappa after rounding is within a factor of 1.5. Other matrices are rejected:
// what rounding has changed says nothing about the formula.
struct Ellipse {
  double angle, large, small;  // large, small: eigenvalues
};
template <class T>
bool rounded(const Ellipse& e, Covariance<T>& s) {
  const longer co = std::cos(longer(e.angle)), si = std::sin(longer(e.angle));
  const longer large = longer(e.large), small = longer(e.small);
  s = {T(co * co * large + si * si * small), T(co * si * (large - small)),
       T(si * si * large + co * co * small), 0};
  if (e.large == e.small) s = {T(large), 0, T(large), 0};
  s.det = exact_det(s.a, s.b, s.c);
  const double found = double(s.det) / (e.large * e.small);
  return found > 1 / 1.5 && found < 1.5;
}
template <class T>
Covariance<T> random_covariance(Random& random, double kappa) {
  Covariance<T> s;
  while (!rounded({random.angle(), 1, 1 / kappa}, s)) {
  }
  return s;
}

// The definition in T, by eigenvectors, without any of the closed forms.
template <class T>
struct Eigen2 {
  T large, small, co, si;  // (co, si) is the eigenvector of `large`
};
template <class T>
Eigen2<T> eigen_of(T a, T b, T c, T det) {
  const T half = std::hypot((a - c) / 2, b), large = (a + c) / 2 + half;
  const T angle = half > 0 ? std::atan2(b, (a - c) / 2) / 2 : T(0);
  return {large, det / large, std::cos(angle), std::sin(angle)};
}
// R diag(l, s) R^T as a, b, c.
template <class T>
struct Sym {
  T a, b, c;
};
template <class T>
Sym<T> from_eigen(const Eigen2<T>& e, T l, T s) {
  return {e.co * e.co * l + e.si * e.si * s, e.co * e.si * (l - s),
          e.si * e.si * l + e.co * e.co * s};
}
template <class T>
struct Full {
  T a, b, c, d;
};
template <class T>
Full<T> product(const Full<T>& x, const Full<T>& y) {
  return {x.a * y.a + x.b * y.c, x.a * y.b + x.b * y.d, x.c * y.a + x.d * y.c,
          x.c * y.b + x.d * y.d};
}
template <class T>
Full<T> full(const Sym<T>& s) {
  return {s.a, s.b, s.b, s.c};
}
// The X with B X + X B = Q, where B has the eigenvectors of e and eigenvalues l, s.
template <class T>
Sym<T> lyapunov_by_eigen(const Eigen2<T>& e, T l, T s, const Full<T>& q) {
  const Full<T> r{e.co, -e.si, e.si, e.co}, rt{e.co, e.si, -e.si, e.co};
  Full<T> m = product(product(rt, q), r);
  m = {m.a / (2 * l), m.b / (l + s), m.c / (l + s), m.d / (2 * s)};
  const Full<T> x = product(product(r, m), rt);
  return {x.a, (x.b + x.c) / 2, x.d};
}

// A, and the gradient of G : A by both covariances.
template <class T>
struct Exact {
  Full<T> a;
  Sym<T> b1, x1, x2;
};
template <class T, class F>
Exact<T> exact(const Covariance<F>& s1, const Covariance<F>& s2, const Full<T>& g) {
  const Eigen2<T> e1 = eigen_of(T(s1.a), T(s1.b), T(s1.c), exact_det(T(s1.a), T(s1.b), T(s1.c)));
  const Eigen2<T> e2 = eigen_of(T(s2.a), T(s2.b), T(s2.c), exact_det(T(s2.a), T(s2.b), T(s2.c)));
  const T l1 = std::sqrt(e1.large), m1 = std::sqrt(e1.small);
  const T l2 = std::sqrt(e2.large), m2 = std::sqrt(e2.small);
  const Full<T> c1 = full(from_eigen(e1, 1 / l1, 1 / m1)), b2 = full(from_eigen(e2, l2, m2));
  Full<T> q2 = product(g, c1), bg = product(b2, g);
  q2.b = q2.c = (q2.b + q2.c) / 2;
  bg.b = bg.c = (bg.b + bg.c) / 2;
  Full<T> q1 = product(product(c1, bg), c1);
  q1 = {-q1.a, -q1.b, -q1.c, -q1.d};
  return {product(b2, c1), from_eigen(e1, l1, m1), lyapunov_by_eigen(e1, l1, m1, q1),
          lyapunov_by_eigen(e2, l2, m2, q2)};
}

double relative(std::initializer_list<longer> differences, std::initializer_list<longer> expected) {
  longer d = 0, e = 0;
  for (const longer x : differences) d += x * x;
  for (const longer x : expected) e += x * x;
  return double(std::sqrt(d / e));
}

Rows double_roots(Queue&) {  // T1
  Random random(1);
  std::vector<double> roots, inverses, maps, maps_by_size, solutions, solutions_by_condition;
  for (int i = 0; i < 10000; ++i) {
    const double kappa = std::pow(10., random.uniform(0, 8));
    const Covariance<double> s1 = random_covariance<double>(random, kappa);
    const Covariance<double> s2 =
        random_covariance<double>(random, std::pow(10., random.uniform(0, 8)));
    const Full<longer> g{longer(random.normal()), longer(random.normal()), longer(random.normal()),
                         longer(random.normal())};
    const Exact<longer> e = exact<longer>(s1, s2, g);
    const Root2 r1 = root2(make_sym2(s1.a, s1.b, s1.c), s1.det);
    const Root2 r2 = root2(make_sym2(s2.a, s2.b, s2.c), s2.det);
    roots.push_back(relative({r1.b.a - e.b1.a, r1.b.b - e.b1.b, r1.b.c - e.b1.c},
                             {e.b1.a, e.b1.b, e.b1.b, e.b1.c}));
    const Sym2 c = sym2_scale(sym2_adj(r1.b), 1 / r1.s);  // inv(B1)
    const Eigen2<longer> of1 = eigen_of<longer>(
        s1.a, s1.b, s1.c, exact_det<longer>(longer(s1.a), longer(s1.b), longer(s1.c)));
    const Sym<longer> inverse = from_eigen(of1, 1 / std::sqrt(of1.large), 1 / std::sqrt(of1.small));
    inverses.push_back(relative({c.a - inverse.a, c.b - inverse.b, c.c - inverse.c},
                                {inverse.a, inverse.b, inverse.b, inverse.c}));
    const Mat2 a = mat2_mul(mat2_of(r2.b), mat2_of(c));
    maps.push_back(relative({a.a - e.a.a, a.b - e.a.b, a.c - e.a.c, a.d - e.a.d},
                            {e.a.a, e.a.b, e.a.c, e.a.d}));
    const double size = std::sqrt(sym2_inner(r2.b, r2.b) * sym2_inner(r1.b, r1.b)) / r1.s;
    maps_by_size.push_back(double(std::hypot(std::hypot(a.a - e.a.a, a.b - e.a.b),
                                             std::hypot(a.c - e.a.c, a.d - e.a.d))) /
                           size);
    const Sym2 q = make_sym2(double(g.a), double(g.b), double(g.d));
    const Sym2 x = lyapunov2(r1.b, r1.s, q);
    const Sym<longer> y =
        lyapunov_by_eigen(of1, std::sqrt(of1.large), std::sqrt(of1.small), {g.a, g.b, g.b, g.d});
    solutions.push_back(relative({x.a - y.a, x.b - y.b, x.c - y.c}, {y.a, y.b, y.b, y.c}));
    solutions_by_condition.push_back(solutions.back() / std::sqrt(kappa));
  }
  // Where B2 and inv(B1) cancel, A has the condition |B2| |inv(B1)|, and X has that of B. The worst
  // errors are therefore scaled by the condition, the 99 % quantiles are not.
  return {{"root, worst of 1e4, kappa to 1e8", worst(roots), 1e-14},
          {"its inverse, worst", worst(inverses), 1e-14},
          {"A = B2 inv(B1), 99 %", quantile(maps, .99), 1e-14},
          {"A = B2 inv(B1), worst, by |B2| |inv(B1)|", worst(maps_by_size), 1e-14},
          {"Lyapunov solution, 99 %", quantile(solutions, .99), 1e-14},
          {"Lyapunov solution, worst, by kappa(B)", worst(solutions_by_condition), 1e-14}};
}

struct MapErrors {
  std::vector<double> maps, gradients;
};

// Given pairs on the device, against double.
MapErrors device_errors(Queue& queue, const std::vector<Covariance<float>>& s1,
                        const std::vector<Covariance<float>>& s2) {
  Random random(2);
  Floats pairs, g;
  for (size_t i = 0; i < s1.size(); ++i) {
    for (const Covariance<float>& s : {s1[i], s2[i]})
      pairs.insert(pairs.end(), {s.a, s.b, s.c, s.det});
    for (int k = 0; k < 4; ++k) g.push_back(float(random.normal()));
  }
  const DeviceMaths::Roots found = DeviceMaths(queue).roots(pairs, g);
  MapErrors errors;
  for (size_t i = 0; i < s1.size(); ++i) {
    const Exact<longer> e = exact<longer>(
        s1[i], s2[i],
        {longer(g[4 * i]), longer(g[4 * i + 1]), longer(g[4 * i + 2]), longer(g[4 * i + 3])});
    const float *a = &found.maps[4 * i], *x = &found.gradients[6 * i];
    errors.maps.push_back(relative({a[0] - e.a.a, a[1] - e.a.b, a[2] - e.a.c, a[3] - e.a.d},
                                   {e.a.a, e.a.b, e.a.c, e.a.d}));
    const Sym<longer>&x1 = e.x1, &x2 = e.x2;
    // The gradient by a, b, c of both as one vector: b counts twice.
    errors.gradients.push_back(relative(
        {x[0] - x1.a, 2 * (x[1] - x1.b), x[2] - x1.c, x[3] - x2.a, 2 * (x[4] - x2.b), x[5] - x2.c},
        {x1.a, 2 * x1.b, x1.c, x2.a, 2 * x2.b, x2.c}));
  }
  return errors;
}

// S2 close to S1, as between two frames: rotated by 0.02, axes changed by 5 % (standard
// deviations).
MapErrors errors_at(Queue& queue, double kappa, double size, int n = 4000) {
  Random random(3);
  std::vector<Covariance<float>> s1, s2;
  while (int(s1.size()) < n) {
    const Ellipse first{random.angle(), size, size / kappa};
    Ellipse second{first.angle + .02 * random.normal(), size * std::exp(.05 * random.normal()),
                   first.small * std::exp(.05 * random.normal())};
    if (kappa == 1) second.small = second.large;
    Covariance<float> a, b;
    if (!rounded(first, a) || !rounded(second, b)) continue;
    s1.push_back(a);
    s2.push_back(b);
  }
  return device_errors(queue, s1, s2);
}

// Bound for 99 %: from 1e6 on a requirement, below about twice the measured error of the closed
// form.
double gradient_bound(double kappa) {
  if (kappa < 2) return 1e-6;
  if (kappa <= 1e2) return 1e-5;
  if (kappa <= 1e4) return 4e-5;
  return kappa <= 1e6 ? 1e-4 : 3e-4;
}

Rows device_roots(Queue& queue) {  // T2
  Rows rows;
  for (const double kappa : {1., 1 + 1e-7, 1 + 1e-3, 1e2, 1e4, 1e6, 1e8}) {
    const MapErrors e = errors_at(queue, kappa, 1);
    const std::string at = kappa < 2 && kappa > 1 ? fmt::format("kappa 1+{:.0e}", kappa - 1)
                                                  : fmt::format("kappa {:.0e}", kappa);
    rows.push_back(
        {at + ", gradient of A, 99 %", quantile(e.gradients, .99), gradient_bound(kappa)});
    // The worst case has quotients with small divisors; a wrong formula would be off by far more.
    rows.push_back(
        {at + ", gradient of A, worst, relative", worst(e.gradients), 30 * gradient_bound(kappa)});
  }
  return rows;
}

Rows round_splats(Queue& queue) {  // T3
  Rows rows;
  const auto round = [](float c) { return Covariance<float>{c, 0, c, exact_det(c, 0.f, c)}; };
  for (const auto& [name, ratio] : {std::pair{"S1 = S2 = c I", 1.},
                                    {"S1 = c I, S2 = 1.7 c I", 1.7},
                                    {"S1 = c I, S2 = c I / 1000", 1e-3}}) {
    std::vector<Covariance<float>> from, to;
    for (int i = 0; i < 100; ++i) {  // .1 px to 1000 px
      const double c = std::pow(10., -2 + .08 * i);
      from.push_back(round(float(c)));
      to.push_back(round(float(ratio * c)));
    }
    const MapErrors e = device_errors(queue, from, to);
    rows.push_back({fmt::format("{}, A", name), worst(e.maps), 1e-6});
    rows.push_back({fmt::format("{}, gradient", name), worst(e.gradients), 1e-6});
  }
  return rows;
}

Rows root_scales(Queue& queue) {  // T4
  Rows rows;
  const double at_one = quantile(errors_at(queue, 1e4, 1).gradients, .99);
  for (int power = -12; power <= 12; power += 3) {
    const MapErrors e = errors_at(queue, 1e4, std::pow(10., power));
    rows.push_back({fmt::format("S x 1e{}, gradient of A, 99 %, vs T2", power),
                    quantile(e.gradients, .99) / at_one, 2});
    rows.push_back({fmt::format("S x 1e{}, gradient of A, worst, relative", power),
                    worst(e.gradients), 30 * gradient_bound(1e4)});
  }
  return rows;
}

}  // namespace

Tests root_tests() {
  return {{"T1", "roots in double", true, double_roots},
          {"T2", "gradient of A given S", true, device_roots},
          {"T3", "equal eigenvalues", true, round_splats},
          {"T4", "scales 1e-12 to 1e12", true, root_scales}};
}

}  // namespace gflow::stress
