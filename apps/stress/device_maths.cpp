// SPDX-License-Identifier: Apache-2.0
#include "apps/stress/device_maths.hpp"

namespace gflow::stress {

DeviceMaths::DeviceMaths(Queue& queue)
    : queue_(queue),
      program_(queue, "checks/stress.cl"),
      roots_(program_, "stress_roots"),
      whiten_(program_, "stress_whiten"),
      transport_(program_, "stress_transport"),
      project_(program_, "stress_project") {}

DeviceMaths::Roots DeviceMaths::roots(const Floats& pairs, const Floats& g) {
  const size_t n = g.size() / 4;
  const Buffer<float> p(queue_, pairs, "pairs"), v(queue_, g, "g");
  Buffer<float> maps(queue_, 4 * n, "maps"), gradients(queue_, 6 * n, "gradients");
  roots_(queue_, Range::over(n), cl_uint(n), p, v, maps, gradients);
  return {maps.read(queue_), gradients.read(queue_)};
}

DeviceMaths::Whitened DeviceMaths::whiten(const Floats& factors, const Floats& offsets) {
  const size_t n = offsets.size() / 2;
  const Buffer<float> m(queue_, factors, "factors"), d(queue_, offsets, "offsets");
  Buffer<float> dets(queue_, n, "dets"), z(queue_, 2 * n, "z");
  whiten_(queue_, Range::over(n), cl_uint(n), m, d, dets, z);
  return {dets.read(queue_), z.read(queue_)};
}

DeviceMaths::Transported DeviceMaths::transport(int mode, const Floats& m1, const Floats& m2,
                                                const Floats& gh) {
  const size_t n = gh.size() / 4;
  const Buffer<float> a(queue_, m1, "m1"), b(queue_, m2, "m2"), g(queue_, gh, "gh");
  Buffer<float> h(queue_, 4 * n, "h"), v1(queue_, 6 * n, "v_m1"), v2(queue_, 6 * n, "v_m2");
  transport_(queue_, Range::over(n), cl_uint(n), cl_int(mode), a, b, g, h, v1, v2);
  return {h.read(queue_), v1.read(queue_), v2.read(queue_)};
}

DeviceMaths::Projected DeviceMaths::project(const PinholeCamera& camera, const Floats& means,
                                            const Floats& factors, const Floats& v_means2d,
                                            const Floats& v_depths, const Floats& v_m) {
  const size_t n = v_depths.size();
  const Buffer<float> a(queue_, means, "means"), b(queue_, factors, "factors");
  const Buffer<float> c(queue_, v_means2d, "v_means2d"), d(queue_, v_depths, "v_depths");
  const Buffer<float> e(queue_, v_m, "v_m");
  Buffer<float> means2d(queue_, 2 * n, "means2d"), m(queue_, 6 * n, "m");
  Buffer<float> v_means(queue_, 3 * n, "v_means"), v_factors(queue_, 9 * n, "v_factors");
  project_(queue_, Range::over(n), cl_uint(n), camera, a, b, c, d, e, means2d, m, v_means,
           v_factors);
  return {means2d.read(queue_), m.read(queue_), v_means.read(queue_), v_factors.read(queue_)};
}

}  // namespace gflow::stress
