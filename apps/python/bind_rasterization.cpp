// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include "apps/python/bindings.hpp"
#include "apps/python/rasterization.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

// A Rasterization with its images and, later, gradients as arrays.
class PyRasterization {
 public:
  explicit PyRasterization(const py::dict& arguments) {
    read(arguments);
    {
      const py::gil_scoped_release unlocked;
      raster_ = std::make_unique<Rasterization>(current_device(), in_);
    }
    make_output();
    const py::gil_scoped_release unlocked;
    raster_->forward(out_, check_interrupt);
  }

  py::dict images() const { return images_; }
  py::dict geometry() const { return geometry_; }
  const std::vector<int32_t>& broken() const { return raster_->broken(); }

  // `wanted`: the arguments whose gradients are returned, and "means2d".
  py::dict backward(const py::dict& cotangents, const std::vector<std::string>& wanted) {
    ImageCotangents v;
    std::vector<FloatArray> held;
    const auto cotangent = [&](const char* name, const float*& to) {
      FloatArray array = argument(cotangents, name);
      if (!cotangents.contains(name) || cotangents[name].is_none()) return;
      to = values(array, shape_of(images_, name), name);
      held.push_back(std::move(array));
    };
    cotangent("colors", v.colors);
    cotangent("alphas", v.alphas);
    if (in_.flow) cotangent("flow", v.flow);
    RasterizationGradients to;
    const std::pair<const char*, float*&> fields[] = {
        {"means", to.means},       {"quats", to.quats},
        {"scales", to.scales},     {"opacities", to.opacities},
        {"colors", to.colors},     {"means_t2", to.means_t2},
        {"quats_t2", to.quats_t2}, {"scales_t2", to.scales_t2},
        {"viewmats", to.viewmats}, {"viewmats_t2", to.viewmats_t2}};
    py::dict gradients;
    const auto add = [&](const char* name, const Shape& shape, float*& field) {
      if (std::find(wanted.begin(), wanted.end(), name) == wanted.end()) return;
      py::array_t<float> array = new_array(shape);
      field = array.mutable_data();
      gradients[name] = array;
    };
    for (const auto& [name, field] : fields)
      if (shapes_.count(name)) add(name, shapes_.at(name), field);
    add("means2d", {py::ssize_t(in_.cameras), py::ssize_t(in_.gaussians), 2}, to.means2d);
    const py::gil_scoped_release unlocked;
    raster_->backward(v, to, check_interrupt);
    return gradients;
  }

 private:
  static Shape shape_of(const py::dict& arrays, const char* name) {
    const auto array = py::cast<py::array>(arrays[name]);
    return {array.shape(), array.shape() + array.ndim()};
  }

  // Checks the arguments' shapes.
  void read(const py::dict& arguments) {
    const auto take = [&](const char* name, const Shape& shape) {
      shapes_[name] = shape;
      held_.push_back(argument(arguments, name));
      return values(held_.back(), shape, name);
    };
    const FloatArray means = argument(arguments, "means");
    if (means.ndim() != 2 || means.shape(1) != 3) refuse_shape(means, "means", "(N, 3)");
    const py::ssize_t n = means.shape(0);
    in_.gaussians = size_t(n);
    in_.means = take("means", {n, 3});
    in_.quats = take("quats", {n, 4});
    in_.scales = take("scales", {n, 3});
    in_.opacities = take("opacities", {n});
    const FloatArray viewmats = argument(arguments, "viewmats");
    if (viewmats.ndim() != 3 || viewmats.shape(0) < 1)
      refuse_shape(viewmats, "viewmats", "(C, 4, 4)");
    const py::ssize_t cameras = viewmats.shape(0);
    in_.cameras = size_t(cameras);
    in_.viewmats = take("viewmats", {cameras, 4, 4});
    in_.Ks = take("Ks", {cameras, 3, 3});
    if (!arguments["backgrounds"].is_none()) in_.backgrounds = take("backgrounds", {cameras, 3});
    in_.width = py::cast<int>(arguments["width"]);
    in_.height = py::cast<int>(arguments["height"]);
    in_.near_plane = py::cast<float>(arguments["near_plane"]);
    in_.depth = py::cast<bool>(arguments["depth"]);
    in_.expected_depth = py::cast<bool>(arguments["expected_depth"]);
    in_.gradients = py::cast<bool>(arguments["gradients"]);
    in_.settings.transport = Transport(py::cast<int>(arguments["transport"]));
    in_.settings.stop = StopRule(py::cast<int>(arguments["stop"]));
    in_.settings.top_k = py::cast<int>(arguments["top_k"]);
    read_colors(arguments, n, cameras);
    in_.flow = py::cast<bool>(arguments["flow"]);
    if (in_.flow) {
      in_.means_t2 = take("means_t2", {n, 3});
      in_.quats_t2 = take("quats_t2", {n, 4});
      in_.scales_t2 = take("scales_t2", {n, 3});
      in_.viewmats_t2 = take("viewmats_t2", {cameras, 4, 4});
    }
  }

  // [N, 3] or, with sh_degree, [N, K, 3]; in front of it C if each camera has its own.
  void read_colors(const py::dict& arguments, py::ssize_t n, py::ssize_t cameras) {
    FloatArray colors = argument(arguments, "colors");
    if (!arguments["sh_degree"].is_none()) in_.sh_degree = py::cast<int>(arguments["sh_degree"]);
    const bool harmonics = in_.sh_degree >= 0;
    const py::ssize_t own = harmonics ? 3 : 2;
    const auto refuse = [&] {
      refuse_shape(colors, "colors",
                   harmonics ? fmt::format("(N, K, 3) or (C, N, K, 3) with K of at least {}",
                                           (in_.sh_degree + 1) * (in_.sh_degree + 1))
                             : "(N, 3) or (C, N, 3): gflow draws three channels");
    };
    if (colors.ndim() != own && colors.ndim() != own + 1) refuse();
    in_.colors_per_camera = colors.ndim() == own + 1;
    Shape shape{n, 3};
    if (harmonics) {
      const py::ssize_t k = colors.shape(colors.ndim() - 2);
      if (k < (in_.sh_degree + 1) * (in_.sh_degree + 1)) refuse();
      in_.coefficients = size_t(k);
      shape = {n, k, 3};
    }
    if (in_.colors_per_camera) shape.insert(shape.begin(), cameras);
    if (colors.shape(colors.ndim() - 1) != 3) refuse();
    in_.colors = values(colors, shape, "colors");
    shapes_["colors"] = shape;
    held_.push_back(std::move(colors));
  }

  void make_output() {
    const auto add = [](py::dict& to, const char* name, auto& field, Shape shape) {
      auto array = new_array<std::remove_pointer_t<std::decay_t<decltype(field)>>>(shape);
      field = array.mutable_data();
      to[name] = array;
    };
    const py::ssize_t n = py::ssize_t(in_.gaussians), cameras = py::ssize_t(in_.cameras);
    const py::ssize_t h = in_.height, w = in_.width;
    add(images_, "colors", out_.colors, {cameras, h, w, py::ssize_t(in_.channels())});
    add(images_, "alphas", out_.alphas, {cameras, h, w, 1});
    if (in_.flow) add(images_, "flow", out_.flow, {cameras, h, w, 2});
    add(geometry_, "radii", out_.radii, {cameras, n, 2});
    add(geometry_, "means2d", out_.means2d, {cameras, n, 2});
    add(geometry_, "depths", out_.depths, {cameras, n});
    add(geometry_, "conics", out_.conics, {cameras, n, 3});
    add(geometry_, "tiles_per_gauss", out_.tiles, {cameras, n});
  }

  RasterizationInput in_;
  RasterizationOutput out_;
  std::map<std::string, Shape> shapes_;
  std::vector<FloatArray> held_;  // the memory of in_
  py::dict images_, geometry_;
  std::unique_ptr<Rasterization> raster_;
};

}  // namespace

void bind_rasterization(py::module_& m) {
  py::class_<PyRasterization>(m, "Rasterization")
      .def(py::init<const py::dict&>())
      .def("images", &PyRasterization::images)
      .def("geometry", &PyRasterization::geometry)
      .def("broken", &PyRasterization::broken)
      .def("backward", &PyRasterization::backward, py::arg("cotangents"), py::arg("wanted"));
  py::list transports, stops;
  for (const char* name : names_of(Transport{})) transports.append(name);
  for (const char* name : names_of(StopRule{})) stops.append(name);
  m.attr("transports") = transports;
  m.attr("stops") = stops;
}

}  // namespace gflow::python
