// SPDX-License-Identifier: Apache-2.0
// T16, T17, T19, T21, T22: compositing of layers (deep, thin, opaque, single), the stop rule, the
// alpha clamp at .99, splats over many tiles, and images of odd sizes.
#include "apps/stress/image/dense.hpp"

namespace gflow::stress {
namespace {

// A stack of layers over one pixel. Splats are far wider than the image, so that opacity equals
// alpha. Colours and flows are random.
PosedScene layers(const std::vector<double>& alphas, unsigned seed) {
  PosedScene s = random_scene({0, 1, 1});
  s.shot.camera = s.shot.camera_t2 = test_camera(1, 1);
  s.shot.camera.cx = s.shot.camera.cy = .5f;
  s.shot.camera_t2 = s.shot.camera;
  Random random(seed);
  for (size_t i = 0; i < alphas.size(); ++i) {
    add_gaussian(s, {0, 0, 2 + 1e-3 * double(i)}, {8, 8, 8}, alphas[i],
                 {.1 * random.normal(), .1 * random.normal(), 0});
    for (int c = 0; c < 3; ++c) s.p["colors"][3 * i + c] = double(float(random.uniform(0, 1)));
  }
  return s;
}

std::vector<double> mixed_alphas(size_t n, Random& random) {
  std::vector<double> a;
  while (a.size() < n) a.push_back(std::min(.98, .004 + std::pow(random.uniform(0, 1), 4)));
  return a;
}
std::vector<double> thin_alphas(size_t n, Random& random) {
  std::vector<double> a;
  while (a.size() < n) a.push_back(random.uniform(1 / 254., .008));
  return a;
}
std::vector<double> hard_alphas(size_t n, double opaque, Random& random) {
  std::vector<double> a;
  while (a.size() < n)
    a.push_back(random.uniform(0, 1) < .15 ? opaque : random.uniform(1 / 254., .05));
  return a;
}

// Compositing of layers with given alphas in double, by definition, and the gradient of v . rgb.
struct Blend {
  double T = 1, flow[2] = {0, 0};
  std::vector<double> by_alpha;
  bool doubtful = false;  // rounding may decide where the pixel stops
};
Blend blend(const PosedScene& s, const std::vector<float>& alphas, real3 v, bool stop) {
  Blend out;
  std::vector<double> before;  // transmittance before each layer
  double W = 0;
  for (size_t i = 0; i < alphas.size(); ++i) {
    out.doubtful |= std::fabs(out.T / double(T_MIN) - 1) < 1e-4;
    if (stop && out.T < double(T_MIN)) break;
    const double w = out.T * double(alphas[i]), z = s.p.at("means")[3 * i + 2];
    before.push_back(out.T);
    W += w;
    for (size_t c = 0; c < 2; ++c)
      out.flow[c] += w * double(c ? s.shot.camera.fy : s.shot.camera.fx) *
                     (s.p.at("means_t2")[3 * i + c] - s.p.at("means")[3 * i + c]) / z;
    out.T *= 1 - double(alphas[i]);
  }
  for (double& f : out.flow) f /= W;
  double behind =
      v.x * s.shot.background[0] + v.y * s.shot.background[1] + v.z * s.shot.background[2];
  out.by_alpha.assign(alphas.size(), 0.);
  for (size_t i = before.size(); i-- > 0;) {
    const double own = dot(v, reference::row3(s.p.at("colors"), i)), a = double(alphas[i]);
    // No gradient through the clamp at .99.
    if (s.p.at("opacities")[i] <= double(ALPHA_MAX)) out.by_alpha[i] = before[i] * (own - behind);
    behind = a * own + (1 - a) * behind;
  }
  return out;
}

// The device's alpha of each layer when it is drawn alone.
std::vector<float> drawn_alphas(Queue& queue, const PosedScene& s) {
  std::vector<float> alphas;
  PosedScene one = layers({.5}, 1);
  DeviceScene device(queue, one, {false, false});
  for (const double opacity : s.p.at("opacities")) {
    one.p["opacities"][0] = opacity;
    device.upload(one);
    alphas.push_back(device.forward().at("alpha")[0]);
  }
  return alphas;
}

struct PixelErrors {
  std::vector<double> gradient, T, flow;  // dL/dalpha / the pixel's largest; relative; / 100 px
  double doubtful = 0;
};
// Flow is compared with an image that does not stop, the rest with one that stops as defined.
void compare_pixel(Queue& queue, const PosedScene& s, PixelErrors& errors) {
  const std::vector<float> alphas = drawn_alphas(queue, s);
  const reference::Planes v = only(random_cotangents(s, 3), "rgb");
  const real3 v_rgb{v.rgb[0], v.rgb[1], v.rgb[2]};
  const Blend expected = blend(s, alphas, v_rgb, true), whole = blend(s, alphas, v_rgb, false);
  if (expected.doubtful) {
    ++errors.doubtful;
    return;
  }
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  const std::vector<float> found = device.backward(v).at("opacities");
  double most = 0, error = 0;
  for (size_t i = 0; i < alphas.size(); ++i) {
    const double by_alpha = double(found[i]) * s.p.at("opacities")[i] / double(alphas[i]);
    most = std::max(most, std::fabs(expected.by_alpha[i]));
    error = worse(error, std::fabs(by_alpha - expected.by_alpha[i]));
  }
  errors.gradient.push_back(error / most);
  errors.T.push_back(std::fabs(double(images.at("transmittance")[0]) / expected.T - 1));
  for (size_t c = 0; c < 2; ++c)
    errors.flow.push_back(std::fabs(double(images.at("flow")[c]) - whole.flow[c]) / 100);
}

Rows deep_pixels(Queue& queue) {  // T16
  Rows rows;
  const auto add = [&](const std::string& name, auto&& alphas) {
    Random random(16);
    PixelErrors e;
    for (unsigned k = 0; k < 20; ++k) compare_pixel(queue, layers(alphas(random), k), e);
    rows.push_back({name + ", pixels skipped as ambiguous", e.doubtful, 2});
    rows.push_back({name + ", dL/dalpha, relative to the largest", worst(e.gradient), 1e-5});
    rows.push_back({name + ", T, relative", worst(e.T), 1e-5});
  };
  add("60 mixed layers", [](Random& r) { return mixed_alphas(60, r); });
  add("600 thin layers", [](Random& r) { return thin_alphas(600, r); });
  // .9899, because at .99 itself rounding decides whether the gradient passes.
  add("60 layers, some of .9899", [](Random& r) { return hard_alphas(60, .9899, r); });
  add("60 layers, some of .999", [](Random& r) { return hard_alphas(60, .999, r); });
  return rows;
}

Rows stop_rule(Queue& queue) {  // T17, flows up to 100 px
  PixelErrors e;
  for (unsigned k = 0; k < 40; ++k) {
    Random random(100 + k);
    PosedScene s = layers(k % 2 ? mixed_alphas(200, random) : hard_alphas(200, .98, random), k);
    for (size_t i = 0; i < s.count(); ++i)
      for (size_t c = 0; c < 2; ++c)
        s.p["means_t2"][3 * i + c] =
            s.p["means"][3 * i + c] +
            double(float(random.uniform(-100, 100) * s.p["means"][3 * i + 2]));
    s.shot.settings.transport = Transport::translate;
    compare_pixel(queue, s, e);
  }
  return {{"pixels skipped as ambiguous", e.doubtful, 4},
          {"flow without a stop, relative to max |f|", worst(e.flow), 2e-4},
          {"gradient, relative to the pixel's largest", worst(e.gradient), 5e-5}};
}

Rows faint(Queue& queue) {  // T19
  Rows rows;
  const double step = 1.0001 / 255;
  {  // a single layer at alpha 1/255: flow and its gradient do not depend on alpha
    PosedScene s = layers({step}, 1);
    s.shot.settings.transport = Transport::translate;
    const reference::Gaussians g = reference::posed(s.p);
    const reference::Rendering r = reference::render(s.shot, g);
    const reference::Planes v = only(random_cotangents(s, 2), "flow");
    const reference::Gaussians expected = reference::render_vjp(s.shot, g, r, v);
    DeviceScene device(queue, s);
    const FloatArrays images = device.forward();
    rows.push_back({"only alpha 1/255, flow, relative",
                    row_error(images.at("flow"), r.images.flow, 0, 2), 1e-6});
    rows.push_back({"only alpha 1/255, gradient by the mean at t2, relative",
                    row_error(device.backward(v).at("means_t2"), expected.means_t2, 0, 3), 1e-6});
  }
  for (const bool empty : {true, false}) {  // no Gaussian; one below 1/255
    PosedScene s = empty ? layers({}, 1) : layers({.0039}, 1);
    DeviceScene device(queue, s);
    double sum = 0;
    const FloatArrays images = device.forward();
    for (const char* name : {"alpha", "depth", "flow"})
      for (const float x : images.at(name)) sum += std::fabs(double(x));
    for (const auto& [name, values] : device.backward(random_cotangents(s, 2)))
      for (const float x : values) sum += x == 0 ? 0 : 1;
    for (int c = 0; c < 3; ++c)
      sum += std::fabs(double(images.at("rgb")[c]) - s.shot.background[c]);
    rows.push_back({empty ? "background only: other images, all gradients"
                          : "W = 0: all but the background, all gradients",
                    sum, 0});
  }
  return rows;
}

// The colour of a pixel as a function of the opacity of its only layer, against the background.
Rows clamp(Queue& queue) {  // T21
  Rows rows;
  const auto colour = [&](double opacity) {
    PosedScene s = layers({opacity}, 1);
    DeviceScene device(queue, s);
    return double(device.forward().at("rgb")[0]);
  };
  for (const auto& [opacity, open] : {std::pair{.9899, true}, {.9901, false}}) {
    PosedScene s = layers({opacity}, 1);
    reference::Planes v = only(random_cotangents(s, 2), "none");
    v.rgb[0] = 1;
    DeviceScene device(queue, s);
    device.forward();
    const double found = double(device.backward(v).at("opacities")[0]);
    const double h = open ? -.05 : .005;  // away from the clamp: linear on either side
    const double difference = (colour(opacity + h) - colour(opacity)) / h;
    rows.push_back({fmt::format("opacity {}, gradient vs one-sided difference", opacity),
                    std::fabs(found - difference), 1e-3});
  }
  // Two splats of .99 leave exactly 1e-4, the stop threshold: rounding may decide either way.
  double most = 0;
  for (const double first :
       {.99, std::nextafter(.99f, 0.f) * 1., std::nextafter(.99f, 1.f) * 1., 1.}) {
    const PosedScene s = layers({first, .99, .9}, 1);
    DeviceScene device(queue, s);
    const double found = double(device.forward().at("rgb")[0]);
    const reference::Gaussians g = reference::posed(s.p);
    const std::vector<reference::Seen> seen = reference::see(s.shot, g);
    reference::Contributors all{{0, 3}, {{0, true}, {1, false}, {2, false}}, {0}};
    all.list[0].clamped = first > .99;
    most = worse(most, std::fabs(found - reference::render(s.shot, g, &all).images.rgb[0]));
  }
  rows.push_back({"two of .99 and 1 on the threshold, colour", most, 1.0001e-4});
  return rows;
}

Rows tiles(Queue& queue) {  // T22
  Rows rows;
  const int sizes[][2] = {{1, 1}, {15, 17}, {17, 15}, {97, 89}, {1920, 1080}};
  for (const auto& [width, height] : sizes) {
    SceneSpec spec;
    spec.n = width > 1000 ? 20 : 150;
    spec.width = width;
    spec.height = height;
    compare_with_dense(queue, random_scene(spec), fmt::format("image {} x {}", width, height),
                       rows);
  }
  for (const int across : {1, 2, 5, 10}) {  // 1 to 100 tiles
    PosedScene s = random_scene({0, 160, 160});
    s.shot.camera = s.shot.camera_t2 = test_camera(160, 160);
    const double sigma = 16. * across / 6.7 * 4 / 160;
    add_gaussian(s, {.013, -.021, 4}, {sigma, sigma, .1}, .9, {.03, .02, .1});
    compare_with_dense(queue, s, fmt::format("one splat over about {} tiles", across * across),
                       rows);
  }
  return rows;
}

}  // namespace

Tests compositing_tests() {
  return {{"T16", "deep pixels", true, deep_pixels},
          {"T17", "stop rule", true, stop_rule},
          {"T19", "faint and empty pixels", true, faint},
          {"T21", "cut at .99", true, clamp},
          {"T22", "tiles and image sizes", true, tiles}};
}

}  // namespace gflow::stress
