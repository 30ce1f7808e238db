// SPDX-License-Identifier: Apache-2.0
// T34-T38: the gradient of the whole image: double against differences, device against double over
// random scenes, each loss alone, both, and a wide image.
#include "apps/stress/errors.hpp"
#include "apps/stress/stress.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

const Transport kTransports[] = {Transport::paper, Transport::ot, Transport::material,
                                 Transport::translate};

// Few Gaussians that cover every case: cut-off, stop, margin. Contributors are fixed, because the
// cut-off steps have no derivative.
Rows against_differences(Queue&) {  // T34
  Rows rows;
  for (const Transport t : kTransports) {
    SceneSpec spec{12, 11, 9, 3, 14, .5, 1.6, .4};
    PosedScene s = random_scene(spec);
    s.shot.settings.transport = t;
    const reference::Rendering r = reference::render(s.shot, reference::posed(s.p));
    const reference::Planes v = random_cotangents(s, 5);
    const reference::Named found =
        reference::posed_vjp(s.p, reference::render_vjp(s.shot, reference::posed(s.p), r, v));
    for (const auto& [name, gradient] : found) {
      if (t == Transport::translate && (name == "quats_t2" || name == "scales_t2")) continue;
      double most = 0, error = 0;
      for (const double x : gradient) most = std::max(most, std::fabs(x));
      for (size_t i = 0; i < gradient.size(); ++i) {
        const double h = 1e-6;
        const double at = s.p.at(name)[i];
        reference::Named moved = s.p;
        double& value = moved.at(name)[i];
        const auto loss = [&](double x) {
          value = x;
          return inner(reference::render(s.shot, reference::posed(moved), &r.contributors).images,
                       v);
        };
        const double difference = (loss(at + h) - loss(at - h)) / (2 * h);
        error = worse(error, std::fabs(difference - gradient[i]));
      }
      rows.push_back({fmt::format("{}, by {}, off differences, of the largest", name_of(t), name),
                      error / most, 1e-6});
    }
  }
  return rows;
}

struct Agreement {
  double cosine = 0, relative = 0;                // of the worst scene; the cosine as 1 - cosine
  double elements = 0, off = 0, false_zeros = 0;  // over all scenes
  double doubtful = 0;                            // share of pixels of the worst scene
};

// Over `count` scenes; each parameter array is a class.
Agreement agreement(Queue& queue, int count) {
  Agreement all;
  for (int k = 0; k < count; ++k) {
    SceneSpec spec;
    spec.n = 60 + size_t(k) % 5 * 30;
    spec.width = 20 + k % 7 * 7;
    spec.height = 40 - k % 5 * 6;
    spec.seed = unsigned(1000 + k);
    spec.cover = 8 + k % 4 * 8;
    spec.opaque = k % 3 == 0 ? .1 : 0;
    PosedScene s = random_scene(spec);
    s.shot.settings.transport = kTransports[k % 4];
    const reference::Gaussians g = reference::posed(s.p);
    const reference::Rendering r = reference::render(s.shot, g);
    const reference::Planes v = random_cotangents(s, unsigned(k), r.contributors.doubtful);
    all.doubtful = std::max(all.doubtful, share_of(r.contributors.doubtful));
    DeviceScene device(queue, s);
    device.forward();
    const FloatArrays found = device.backward(v);
    double dots = 0, a2 = 0, e2 = 0;
    for (const auto& [name, expected] :
         reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v))) {
      const std::vector<float>& actual = found.at(name);
      double most = 0;
      for (const double x : expected) most = std::max(most, std::fabs(x));
      double class_dots = 0, class_a2 = 0, class_e2 = 0, class_d2 = 0;
      for (size_t i = 0; i < expected.size(); ++i) {
        const double a = double(actual[i]), e = expected[i];
        class_dots += a * e;
        class_a2 += a * a;
        class_e2 += e * e;
        class_d2 += (a - e) * (a - e);
        if (std::fabs(e) > 1e-3 * most) {  // ignores the band near zero
          ++all.elements;
          all.off += !(std::fabs(a - e) <= 1e-3 * std::fabs(e));
          all.false_zeros += a == 0;
        }
      }
      if (class_e2 == 0) continue;
      all.relative = worse(all.relative, std::sqrt(class_d2 / class_e2));
      dots += class_dots / class_e2;  // equal weight for all classes
      a2 += class_a2 / class_e2;
      e2 += 1;
    }
    all.cosine = worse(all.cosine, 1 - dots / std::sqrt(a2 * e2));
  }
  return all;
}

Rows against_double(Queue& queue, int count) {  // T35
  const Agreement a = agreement(queue, count);
  const std::string of = fmt::format("{} scenes: ", count);
  return {{of + "1 - cosine, worst scene", a.cosine, 1e-5},
          {of + "relative L2 of a class, worst scene", a.relative, 1e-4},
          {fmt::format("{}share of {:.0f} elements off by more than 1e-3", of, a.elements),
           a.off / a.elements, 1e-3},
          {of + "false zeros", a.false_zeros, 0},
          {of + "share of pixels skipped as ambiguous, worst scene", a.doubtful, kMostDoubtful}};
}

PosedScene small_scene(Transport t) {
  PosedScene s = random_scene({80, 45, 30, 9});
  s.shot.settings.transport = t;
  return s;
}

Rows flow_alone(Queue& queue) {  // T36
  Rows rows;
  for (const Transport t : {Transport::paper, Transport::ot, Transport::material}) {
    const PosedScene s = small_scene(t);
    const reference::Gaussians g = reference::posed(s.p);
    const reference::Rendering r = reference::render(s.shot, g);
    rows.push_back({fmt::format("{}, share of pixels skipped as ambiguous", name_of(t)),
                    share_of(r.contributors.doubtful), kMostDoubtful});
    const reference::Planes v = only(random_cotangents(s, 4, r.contributors.doubtful), "flow");
    DeviceScene device(queue, s);
    device.forward();
    const FloatArrays found = device.backward(v);
    for (const auto& [name, expected] :
         reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v))) {
      if (name == "colors") continue;
      const std::string at = fmt::format("{}, by {}", name_of(t), name);
      rows.push_back({at + ", relative L2", relative_l2(found.at(name), expected), 1e-4});
      rows.push_back({at + ", 1 / length", 1 / norm(found.at(name)), 1e3});
    }
  }
  return rows;
}

Rows sums(Queue& queue) {  // T37
  Rows rows;
  const PosedScene s = small_scene(Transport::material);
  DeviceScene device(queue, s), without(queue, s, {false, true});
  device.forward();
  without.forward();
  reference::Planes both = random_cotangents(s, 1);
  std::fill(both.depth.begin(), both.depth.end(), 0.);
  reference::Planes photo = both;
  std::fill(photo.flow.begin(), photo.flow.end(), 0.);
  const FloatArrays sum = device.backward(both), a = device.backward(photo),
                    b = device.backward(only(both, "flow"));
  for (const auto& [name, values] : sum) {
    std::vector<double> expected;
    for (size_t i = 0; i < values.size(); ++i)
      expected.push_back(double(a.at(name)[i]) + double(b.at(name)[i]));
    rows.push_back({"both vs the sum, by " + name, relative_l2(values, expected), 1e-6});
  }
  double different = 0;
  for (const auto& [name, values] : without.backward(photo)) different += values != a.at(name);
  rows.push_back({"image loss only: arrays that differ without flow", different, 0});
  return rows;
}

Rows wide_image(Queue& queue) {  // T38
  Rows rows;
  SceneSpec spec;
  spec.n = 400;
  spec.width = 320;
  spec.height = 96;
  PosedScene s = random_scene(spec);
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  rows.push_back({"320 x 96: flow vs dense formula [px]",
                  largest_error(images.at("flow"), r.images.flow, r.contributors.doubtful), 1e-3});
  rows.push_back({"320 x 96: share of pixels skipped as ambiguous",
                  share_of(r.contributors.doubtful), kMostDoubtful});
  for (const char* image : {"rgb", "flow"}) {
    const reference::Planes v = only(random_cotangents(s, 38, r.contributors.doubtful), image);
    const reference::Gaussians expected = reference::render_vjp(s.shot, g, r, v);
    const std::vector<float> found = device.backward(v).at("means");
    double dots = 0;
    for (size_t i = 0; i < found.size(); ++i) dots += double(found[i]) * expected.means[i];
    rows.push_back({fmt::format("320 x 96: gradient of {} by means, 1 - cosine", image),
                    1 - dots / norm(found) / norm(expected.means), 1e-6});
    rows.push_back({fmt::format("320 x 96: gradient of {} by means, length", image),
                    std::fabs(norm(found) / norm(expected.means) - 1), 1e-5});
  }
  return rows;
}

}  // namespace

Tests gradient_tests() {
  return {{"T34", "double vs differences", true, against_differences},
          {"T35", "device vs double", true, [](Queue& q) { return against_double(q, 24); }},
          {"T35", "the same, 1000 scenes", false, [](Queue& q) { return against_double(q, 1000); }},
          {"T36", "flow loss only", true, flow_alone},
          {"T37", "sum of losses", true, sums},
          {"T38", "wide image", true, wide_image}};
}

}  // namespace gflow::stress
