// SPDX-License-Identifier: Apache-2.0
#include "apps/python/python_objective.hpp"

#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>

#include "apps/python/cameras.hpp"
#include "apps/python/rasterization.hpp"
#include "optim/images/image.hpp"
#include "optim/objectives/crop.hpp"
#include "optim/scene/frame_store.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

using FloatsOf = py::array_t<float, py::array::c_style | py::array::forcecast>;

class PythonObjective : public Objective {
 public:
  PythonObjective(py::handle object, FrameStore& frames) : object_(object), frames_(frames) {
    const py::gil_scoped_acquire lock;
    name_ = py::cast<std::string>(object.attr("name"));
    for (const auto& channel : py::cast<std::vector<std::string>>(object.attr("channels"))) {
      if (channel != "depth" && channel != "flow")
        throw InputError(fmt::format(
            "objective '{}': there is no channel '{}', choose depth or flow", name_, channel));
      depth_ |= channel == "depth";
      flow_ |= channel == "flow";
    }
  }

  void request(Queue&, const ViewContext&, Shot& shot) override {
    shot.depth |= depth_;
    shot.flow |= flow_;  // to shot.time_t2, which is a step later or earlier if nobody else set it
  }

  void begin_step(Queue&, const StepContext&) override { value_ = std::nan(""); }

  void add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                     ImageGradients& v) override {
    const Images& images = renderer.images();
    const Rect& part = view.sample.part;
    const std::vector<float> rgb = images.rgb.read(queue), alpha = images.alpha.read(queue);
    const std::vector<float> depth = depth_ ? images.depth.read(queue) : std::vector<float>();
    const bool with_flow = flow_ && renderer.shot().flow;
    const std::vector<float> flow = with_flow ? images.flow.read(queue) : std::vector<float>();
    const std::vector<float> truth = truth_of(view);
    const py::gil_scoped_acquire lock;
    py::dict arguments;
    const auto give = [&](const char* name, const std::vector<float>& planes, size_t channels) {
      py::array_t<float> array(Shape{part.height, part.width, py::ssize_t(channels)});
      from_planes(planes, channels, array.mutable_data());
      arguments[name] = array;
    };
    give("colors", rgb, 3);
    give("alphas", alpha, 1);
    if (depth_) give("depth", depth, 1);
    if (with_flow) give("flow", flow, 2);
    give("truth", truth, 3);
    arguments["step"] = view.step;
    arguments["name"] = view.sample.frame->name;
    arguments["time"] = view.sample.frame->time;
    arguments["time_t2"] = renderer.shot().time_t2;
    arguments["left"] = part.x;
    arguments["top"] = part.y;
    arguments["share"] = view.share;
    const py::object result = object_.attr("_call")(arguments);
    const auto pair = py::cast<py::tuple>(result);
    const double value = py::cast<double>(pair[0]);
    value_ = std::isnan(value_) ? value : value_ + value;
    if (!std::isfinite(value))
      throw InputError(fmt::format("objective '{}': its loss is {}", name_, value));
    const auto gradients = py::cast<py::dict>(pair[1]);
    for (const auto& [key, gradient] : gradients)
      if (const auto name = py::cast<std::string>(key); !has_gradient(name, with_flow))
        throw InputError(
            fmt::format("objective '{}': there is no image '{}' to have a gradient; its images are "
                        "colors, alphas and those that its channels name",
                        name_, name));
    add(queue, gradients, "colors", 3, part, v.v_rgb);
    add(queue, gradients, "alphas", 1, part, v.v_alpha);
    if (depth_) add(queue, gradients, "depth", 1, part, v.v_depth);
    if (with_flow) add(queue, gradients, "flow", 2, part, v.v_flow);
  }

  void report(Queue&, const Renderer&, LossReport& report) override {
    if (!std::isnan(value_)) report.loss += value_;
    report.terms.push_back({name_, value_, fmt::format("{} {:.3g}", name_, value_)});
  }

 private:
  bool has_gradient(const std::string& image, bool with_flow) const {
    return image == "colors" || image == "alphas" || (image == "depth" && depth_) ||
           (image == "flow" && with_flow);
  }

  // [h, w, channels] of [channels, h, w].
  static void from_planes(const std::vector<float>& planes, size_t channels, float* to) {
    const size_t pixels = planes.size() / channels;
    for (size_t i = 0; i < pixels; ++i)
      for (size_t c = 0; c < channels; ++c) to[channels * i + c] = planes[c * pixels + i];
  }

  // The image to compare with, as planes, over the background of the step.
  std::vector<float> truth_of(const ViewContext& view) {
    const Image whole = frames_.rgb_over(*view.sample.frame, view.background);
    std::vector<uint8_t> bytes;
    crop(whole.pixels, view.width, 3, view.sample.part, bytes);
    const size_t pixels = bytes.size() / 3;
    std::vector<float> planes(bytes.size());
    for (size_t i = 0; i < pixels; ++i)
      for (size_t c = 0; c < 3; ++c) planes[c * pixels + i] = float(bytes[3 * i + c]) / 255;
    return planes;
  }

  void add(Queue& queue, const py::dict& gradients, const char* name, size_t channels,
           const Rect& part, Buffer<float>& v) {
    if (!gradients.contains(name)) return;
    const auto array = py::cast<FloatsOf>(gradients[name]);
    const bool fits = array.ndim() == 3 && array.shape(0) == part.height &&
                      array.shape(1) == part.width && array.shape(2) == py::ssize_t(channels);
    if (!fits)
      throw InputError(
          fmt::format("objective '{}': its gradient '{}' should have the shape of the image, "
                      "({}, {}, {})",
                      name_, name, part.height, part.width, channels));
    if (!std::all_of(array.data(), array.data() + array.size(),
                     [](float x) { return std::isfinite(x); }))
      throw InputError(
          fmt::format("objective '{}': its gradient '{}' has a NaN or Inf", name_, name));
    std::vector<float> sum = v.read(queue);
    const size_t pixels = sum.size() / channels;
    for (size_t i = 0; i < pixels; ++i)
      for (size_t c = 0; c < channels; ++c) sum[c * pixels + i] += array.data()[channels * i + c];
    v.write(queue, sum);
  }

  py::handle object_;
  FrameStore& frames_;
  std::string name_;
  bool depth_ = false, flow_ = false;
  double value_ = std::nan("");
};

}  // namespace

MakeObjective python_objective(py::handle object) {
  return [object](const TrainInputs& inputs) -> std::unique_ptr<Objective> {
    return std::make_unique<PythonObjective>(object, inputs.frames);
  };
}

}  // namespace gflow::python
