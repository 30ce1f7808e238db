// SPDX-License-Identifier: Apache-2.0
// A test scene on the device: uploaded once, rendered and differentiated by the engine, results
// read back by name. Also comparison of results.
#pragma once
#include <cstring>

#include "optim/engine/camera_gradient.hpp"
#include "optim/engine/posed.hpp"
#include "optim/reference/scenes.hpp"
#include "runtime/base/worse.hpp"

namespace gflow {

using FloatArrays = std::map<std::string, std::vector<float>>;

inline std::vector<float> to_float(const std::vector<double>& a) {
  return std::vector<float>(a.begin(), a.end());
}

// Reads an output and checks that every value was written. With GFLOW_POISON_BUFFERS memory
// initially holds a bit pattern that no kernel computes.
inline std::vector<float> written(Queue& queue, const Buffer<float>& output) {
  std::vector<float> values = output.read(queue);
  for (size_t i = 0; i < values.size(); ++i) {
    uint32_t bits;
    std::memcpy(&bits, &values[i], sizeof bits);
    if (bits == poison)
      throw Error(
          fmt::format("{}: value {} of {} was never written", output.name(), i, values.size()));
  }
  return values;
}

class DeviceScene {
 public:
  DeviceScene(Queue& queue, const PosedScene& scene, Channels channels = {})
      : engine(queue, scene.shot.settings),
        queue_(queue),
        posed_(queue),
        channels_(channels),
        view_{scene.shot.camera, scene.shot.camera_t2},
        background_{float(scene.shot.background[0]), float(scene.shot.background[1]),
                    float(scene.shot.background[2])} {
    upload(scene);
  }

  void upload(const PosedScene& scene) {
    const size_t n = scene.count();
    const auto write = [&](Buffer<float>& buffer, const char* name) {
      buffer.ensure(queue_, scene.p.at(name).size());
      buffer.write(queue_, to_float(scene.p.at(name)));
    };
    t1_.ensure(queue_, n);
    t2_.ensure(queue_, n);
    write(t1_.means, "means");
    write(t1_.opacities, "opacities");
    write(t2_.means, "means_t2");
    write(colors_, "colors");
    write(quats_, "quats");
    write(scales_, "scales");
    write(quats2_, "quats_t2");
    write(scales2_, "scales_t2");
  }

  // Sets other cameras with the same image size.
  void aim(const PinholeCamera& camera, const PinholeCamera& camera_t2) {
    view_.camera = camera;
    view_.camera_t2 = camera_t2;
  }

  // Sets a Gaussian's pose at t2 to NaN, to show that it is not read.
  void break_second_pose_of(size_t row) {
    t2_.means.fill_range(queue_, 3 * row, 3, std::numeric_limits<float>::quiet_NaN());
    quats2_.fill_range(queue_, 4 * row, 4, std::numeric_limits<float>::quiet_NaN());
  }

  // Sets View::moving. Static rows get a wrong pose at t2, which must not be read.
  void stand_still_from(size_t row) {
    view_.moving = row;
    const size_t rest = t2_.opacities.size() - row;
    t2_.means.fill_range(queue_, 3 * row, 3 * rest, 3.f);
    quats2_.fill_range(queue_, 4 * row, 4 * rest, 0.5f);
  }

  // Sets View::flow_tiles.
  void ask_flow_of(const std::vector<float>& tiles) {
    flow_tiles_.ensure(queue_, tiles.size());
    flow_tiles_.write(queue_, tiles);
    view_.flow_tiles = &flow_tiles_;
  }

  // rgb, alpha, transmittance, and depth and flow if the channels have them.
  FloatArrays forward() {
    posed_.forward(queue_, quats_, scales_, t1_.factors);
    posed_.forward(queue_, quats2_, scales2_, t2_.factors);
    engine.forward(queue_, view_, channels_, background_, t1_, t2_, colors_);
    const Images& images = engine.images();
    FloatArrays out{{"rgb", written(queue_, images.rgb)},
                    {"alpha", written(queue_, images.alpha)},
                    {"transmittance", written(queue_, images.transmittance)}};
    if (channels_.depth) out["depth"] = written(queue_, images.depth);
    if (channels_.flow) out["flow"] = written(queue_, images.flow);
    return out;
  }

  // Gradients of sum(images . v) of the last forward(), by parameter name.
  FloatArrays backward(const reference::Planes& v) {
    ImageGradients images;
    images.flow_in_parts = flow_in_parts;
    const auto write = [&](Buffer<float>& buffer, const std::vector<double>& values) {
      buffer.ensure(queue_, values.size());
      buffer.write(queue_, to_float(values));
    };
    write(images.v_rgb, v.rgb);
    write(images.v_alpha, v.alpha);
    if (channels_.depth) write(images.v_depth, v.depth);
    if (channels_.flow) write(images.v_flow, v.flow);
    if (keep_gradients)
      gradients.ensure(queue_, t1_.opacities.size());
    else
      gradients.zero(queue_, t1_.opacities.size());
    engine.backward(queue_, t1_, t2_, images, gradients);
    Buffer<float> v_quats, v_scales;
    posed_.backward(queue_, quats_, scales_, gradients.v_factors, v_quats, v_scales);
    FloatArrays out{{"means", gradients.v_means.read(queue_)},
                    {"quats", v_quats.read(queue_)},
                    {"scales", v_scales.read(queue_)},
                    {"opacities", gradients.v_opacities.read(queue_)},
                    {"colors", gradients.v_colors.read(queue_)}};
    if (!channels_.flow) return out;
    posed_.backward(queue_, quats2_, scales2_, gradients.v_factors_t2, v_quats, v_scales);
    out["means_t2"] = gradients.v_means_t2.read(queue_);
    out["quats_t2"] = v_quats.read(queue_);
    out["scales_t2"] = v_scales.read(queue_);
    return out;
  }

  // Gradients by the cameras at t1 and t2 of the last backward().
  std::vector<CameraSums> camera_gradients() {
    CameraGradients cameras(queue_);
    cameras.start(queue_, view_, channels_.flow, engine.splats(), t1_, t2_, gradients);
    return cameras.take(queue_);
  }

  Engine engine;
  GaussianGradients gradients;
  bool flow_in_parts = false;   // see ImageGradients
  bool keep_gradients = false;  // keep what rows that are not visible hold; else 0

 private:
  Queue& queue_;
  Posed posed_;
  Channels channels_;
  View view_;
  std::array<float, 3> background_;
  Buffer<float> flow_tiles_{"flow tiles"};
  GaussiansAt t1_, t2_;
  Buffer<float> colors_{"colors"}, quats_{"quats"}, scales_{"scales"}, quats2_{"quats_t2"},
      scales2_{"scales_t2"};
};

inline void require_same_size(size_t actual, size_t expected) {
  if (actual != expected) throw Error(fmt::format("{} values instead of {}", actual, expected));
}

// Euclidean norm of a vector, or of the difference of two.
template <class A>
double norm(const std::vector<A>& a) {
  double sum = 0;
  for (A x : a) sum += double(x) * double(x);
  return std::sqrt(sum);
}
template <class A, class E>
double distance(const std::vector<A>& a, const std::vector<E>& b) {
  require_same_size(a.size(), b.size());
  double sum = 0;
  for (size_t i = 0; i < b.size(); ++i)
    sum += (double(a[i]) - double(b[i])) * (double(a[i]) - double(b[i]));
  return std::sqrt(sum);
}
// actual - expected| / |expected|; 0 if both are 0.
template <class A, class E>
double relative_l2(const std::vector<A>& actual, const std::vector<E>& expected) {
  const double difference = distance(actual, expected);
  return difference == 0 ? 0 : difference / std::max(norm(expected), 1e-30);
}
// Largest |actual - expected| over pixels that are not doubtful; infinity for NaN.
template <class E>
double largest_error(const std::vector<float>& actual, const std::vector<E>& expected,
                     const std::vector<uint8_t>& doubtful) {
  require_same_size(actual.size(), expected.size());
  double worst = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    if (doubtful[i % doubtful.size()]) continue;
    worst = worse(worst, std::fabs(double(actual[i]) - double(expected[i])));
  }
  return worst;
}

}  // namespace gflow
