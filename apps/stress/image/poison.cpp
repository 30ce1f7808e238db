// SPDX-License-Identifier: Apache-2.0
// T29: one broken value in one Gaussian at the left of an image, in every input of the engine. At
// the right no bit may change, and the broken Gaussian must be detectable: culled if the value is
// not finite or too large to draw. A broken camera affects everything; its results must be finite.
#include <functional>
#include <limits>
#include <map>

#include "apps/stress/errors.hpp"
#include "apps/stress/image/poisoned.hpp"
#include "apps/stress/stress.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/reference/device_scene.hpp"

namespace gflow::stress {
namespace {

PosedScene two_sides() {
  PosedScene s = random_scene({0, kPoisonedWidth, kPoisonedHeight});
  s.shot.camera = s.shot.camera_t2 = test_camera(kPoisonedWidth, kPoisonedHeight);
  add_gaussian(s, {-1.6, .1, 4}, {.1, .08, .1}, .6, {.1, 0, 0});
  add_gaussian(s, {-1.6, 0, 5}, {.2, .1, .1}, .7, {0, .1, 0});
  for (int i = 0; i < 6; ++i)
    add_gaussian(s, {1.3 + .06 * i, .1 * i - .2, 4. + .1 * i}, {.1, .06, .1}, .6, {.1, .05, .1});
  return s;
}

struct Harm {
  double images_changed = 0, gradients_changed = 0, not_finite = 0, unnamed = 0, cases = 0;
  double left_out = 0;  // cases of finite values in which the culprit is not drawn, or has no flow
  double reached = 0;   // cases in which the culprit is really at the right; nothing is compared
  double own = 0;  // nonzero gradients of a culprit that is not drawn, or at t2 of one without flow
};

class Poisoned {
 public:
  explicit Poisoned(Queue& queue)
      : queue_(queue),
        clean_(two_sides()),
        v_(random_cotangents(clean_, 10)),
        device_(queue, clean_),
        images_(device_.forward()),
        gradients_(device_.backward(v_)) {
    for (const char* slot : {"quats", "quats_t2"}) {
      PosedScene s = clean_;
      for (size_t k = 0; k < 4; ++k) s.p[slot][k] = k == 0;
      device_.upload(s);
      device_.forward();
      unturned_[slot] = culprits_record();
    }
    without_ = drawn_with("opacities", 0);
    unmoved_ = drawn_with("means_t2", std::nan(""));
    device_.upload(clean_);
    device_.forward();
  }

  const reference::Named& slots() const { return clean_.p; }

  // Every poison in every component of `slot`.
  Harm gaussian(const std::string& slot) {
    Harm harm;
    for (size_t component = 0; component < clean_.p.at(slot).size() / clean_.count(); ++component)
      for (const float poison : poisons()) {
        PosedScene s = clean_;
        s.p[slot][component] = double(poison);
        device_.upload(s);
        const FloatArrays found = device_.forward();
        const bool reaches = std::isfinite(poison) && reaches_right(queue_, device_.engine);
        harm.reached += reaches;
        compare_images(found, reaches, harm);
        const FloatArrays gradients = device_.backward(v_);
        compare_gradients(gradients, reaches, harm);
        harm.own += own_gradients(slot, gradients);
        const bool drops = std::isfinite(poison) && left_out(slot, found);
        harm.left_out += drops;
        if (drops || !std::isfinite(poison)) harm.unnamed += !named(slot);
        ++harm.cases;
      }
    device_.upload(clean_);
    device_.forward();
    return harm;
  }

  // Every poison in a pixel at the left of an image's cotangent.
  Harm cotangent(const std::string& image) {
    Harm harm;
    for (const float poison : poisons()) {
      reference::Planes v = v_;
      std::vector<double>& plane = image == "rgb"     ? v.rgb
                                   : image == "alpha" ? v.alpha
                                   : image == "depth" ? v.depth
                                                      : v.flow;
      plane[16 * kPoisonedWidth + 8] = double(poison);
      const FloatArrays g = device_.backward(v);
      for (const auto& [name, gradient] : g) {
        const size_t width = gradient.size() / clean_.count();
        for (size_t i = 2 * width; i < gradient.size(); ++i)
          harm.gradients_changed += !same_bits(gradient[i], gradients_.at(name)[i]);
      }
      ++harm.cases;
    }
    return harm;
  }

 private:
  FloatArrays drawn_with(const std::string& slot, double culprits) {
    PosedScene s = clean_;
    s.p[slot][0] = culprits;
    device_.upload(s);
    return device_.forward();
  }
  // Whether the image is that without the culprit or, for a slot at t2, that without its flow.
  bool left_out(const std::string& slot, const FloatArrays& found) const {
    const auto equal = [&](const char* image, const FloatArrays& other) {
      return same_image(found.at(image), other.at(image));
    };
    if (slot.find("_t2") != std::string::npos) return equal("flow", unmoved_);
    return equal("rgb", without_) && equal("alpha", without_) && equal("depth", without_);
  }
  // Whether the engine's own arrays show which Gaussian is broken: culled; without a colour;
  // without flow; or, for a quaternion, without a rotation.
  bool named(const std::string& slot) {
    const std::vector<float> r = culprits_record();
    const bool seen = device_.engine.splats().tiles_touched.read_range(queue_, 0, 1)[0] > 0;
    const auto unturned = unturned_.find(slot);
    if (unturned != unturned_.end()) return seen && r == unturned->second;
    if (slot == "colors") return r[5] == -HUGE_VALF;
    const bool moves = r[7] != 0 || r[11] != 0 || r[12] != 0 || r[13] != 0 || r[14] != 0;
    return slot == "means_t2" || slot == "scales_t2" ? seen && !moves : !seen;
  }
  void compare_images(const FloatArrays& found, bool reaches, Harm& harm) const {
    for (const auto& [name, image] : found) {
      harm.not_finite += count_not_finite(image);
      if (!reaches) harm.images_changed += changed_at_right(image, images_.at(name));
    }
  }
  void compare_gradients(const FloatArrays& found, bool reaches, Harm& harm) const {
    for (const auto& [name, gradient] : found) {
      const size_t width = gradient.size() / clean_.count();
      for (size_t i = width; i < gradient.size(); ++i) {
        harm.not_finite += !std::isfinite(gradient[i]);
        harm.gradients_changed +=
            !reaches && i >= 2 * width && !same_bits(gradient[i], gradients_.at(name)[i]);
      }
    }
  }

  // Nonzero gradients of a culprit that is not drawn, or at t2 of one that is drawn without flow.
  double own_gradients(const std::string& slot, const FloatArrays& found) {
    const bool seen = device_.engine.splats().tiles_touched.read_range(queue_, 0, 1)[0] > 0;
    const std::vector<float> r = culprits_record();
    const bool stays = r[7] == 0 && r[11] == 0 && r[12] == 0 && r[13] == 0 && r[14] == 0;
    double count = 0;
    for (const auto& [name, gradient] : found) {
      const bool at_t2 = name.find("_t2") != std::string::npos;
      if (seen && !(at_t2 && stays && (slot == "means_t2" || slot == "scales_t2"))) continue;
      const size_t width = gradient.size() / clean_.count();
      for (size_t i = 0; i < width; ++i) count += gradient[i] != 0;  // also counts NaN
    }
    return count;
  }

  std::vector<float> culprits_record() {
    return device_.engine.splats().records.read_range(queue_, 0, 16);
  }

  Queue& queue_;
  PosedScene clean_;
  reference::Planes v_;
  DeviceScene device_;
  FloatArrays images_, gradients_;
  FloatArrays without_, unmoved_;  // images without the culprit, and without its flow
  std::map<std::string, std::vector<float>> unturned_;  // the culprit's record without a rotation
};

using Number = std::function<float&(PinholeCamera&)>;
void broken_camera(DeviceScene& device, const PosedScene& s, const reference::Planes& v, bool both,
                   const Number& number, Harm& harm) {
  for (const float poison : poisons()) {
    PinholeCamera camera = s.shot.camera, camera_t2 = s.shot.camera_t2;
    if (both) number(camera) = poison;
    number(camera_t2) = poison;
    device.aim(camera, camera_t2);
    for (const auto& [name, image] : device.forward()) harm.not_finite += count_not_finite(image);
    for (const auto& [name, gradient] : device.backward(v))
      harm.not_finite += count_not_finite(gradient);
    ++harm.cases;
  }
}

// Every poison in every value of both cameras, or only of the one at t2: images and gradients must
// be finite.
Harm camera(Queue& queue, bool both) {
  const PosedScene s = two_sides();
  const reference::Planes v = random_cotangents(s, 10);
  DeviceScene device(queue, s);
  Harm harm;
  for (float PinholeCamera::*number :
       {&PinholeCamera::fx, &PinholeCamera::fy, &PinholeCamera::cx, &PinholeCamera::cy,
        &PinholeCamera::near_plane, &PinholeCamera::left, &PinholeCamera::top})
    broken_camera(
        device, s, v, both, [&](PinholeCamera& c) -> float& { return c.*number; }, harm);
  for (int k = 0; k < 9; ++k)
    broken_camera(
        device, s, v, both, [&](PinholeCamera& c) -> float& { return c.rotation[k]; }, harm);
  for (int k = 0; k < 3; ++k)
    broken_camera(
        device, s, v, both, [&](PinholeCamera& c) -> float& { return c.translation[k]; }, harm);
  return harm;
}

// Poison in one pixel of the target flow. Gradients of other pixels must not change, its own must
// be finite, and an unusable vector must not count as confident.
Row broken_target_flow(Queue& queue) {
  constexpr int width = 19, height = 3;
  constexpr size_t pixels = size_t(width) * height, culprit = width + 4;
  Random random(70);
  std::vector<float> flow, target_flow;
  for (size_t i = 0; i < 2 * pixels; ++i)
    flow.push_back(float(random.normal())), target_flow.push_back(float(random.normal()));
  const Buffer<float> alpha(queue, std::vector<float>(pixels, .5f), "alpha");
  const Buffer<float> drawn(queue, flow, "flow");
  const Buffer<cl_uchar> confidence(queue, std::vector<cl_uchar>(pixels, cl_uchar(255)), "trust");
  FlowLoss loss(queue, .1f);
  Buffer<float> v(queue, 2 * pixels, "v_flow");
  const auto gradient = [&](const std::vector<float>& asked) {
    loss.run(queue, 1, width, height, drawn, alpha, Buffer<float>(queue, asked, "teacher"),
             confidence, v);
    return v.read(queue);
  };
  const std::vector<float> clean = gradient(target_flow);
  double harm = 0, cases = 0;
  for (const size_t axis : {culprit, pixels + culprit})
    for (const float poison : poisons()) {
      std::vector<float> asked = target_flow;
      asked[axis] = poison;
      const std::vector<float> found = gradient(asked);
      harm += count_not_finite(found);
      for (size_t i = 0; i < found.size(); ++i)
        harm += i % pixels != culprit && !same_bits(found[i], clean[i]);
      const FlowLossValue value = loss.value(queue);
      const bool usable = std::fabs(poison) <= 1e5f;
      harm += !std::isfinite(value.loss) || value.confident_pixels != double(pixels - !usable);
      ++cases;
    }
  return {fmt::format("target flow, {:.0f} cases: others' gradients changed, non-finite, not "
                      "skipped",
                      cases),
          harm, 0};
}

Rows poison(Queue& queue) {
  Rows rows;
  Poisoned scene(queue);
  for (const auto& [slot, values] : scene.slots()) {
    const Harm h = scene.gaussian(slot);
    const std::string at = fmt::format("{}, {:.0f} cases", slot, h.cases);
    rows.push_back({at + ": others' pixels changed", h.images_changed, 0});
    rows.push_back({at + ": others' gradients changed", h.gradients_changed, 0});
    rows.push_back({at + ": non-finite", h.not_finite, 0});
    rows.push_back(
        {fmt::format("{}: culprit not reported (of {:.0f} cases that skip it)", at, h.left_out),
         h.unnamed, 0});
    rows.push_back({at + ": gradients of the culprit where it is skipped", h.own, 0});
    rows.push_back({at + ": share of cases that affect the others", h.reached / h.cases, .125});
  }
  for (const char* image : {"rgb", "alpha", "depth", "flow"}) {
    const Harm h = scene.cotangent(image);
    rows.push_back({fmt::format("v_{}, {:.0f} cases: others' gradients changed", image, h.cases),
                    h.gradients_changed, 0});
  }
  for (const bool both : {true, false}) {
    const Harm h = camera(queue, both);
    rows.push_back(
        {fmt::format("{}, {:.0f} cases: non-finite", both ? "cameras" : "camera at t2", h.cases),
         h.not_finite, 0});
  }
  rows.push_back(broken_target_flow(queue));
  return rows;
}

}  // namespace

Tests poison_tests() { return {{"T29", "poison", true, poison}}; }

}  // namespace gflow::stress
