// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include "apps/python/cameras.hpp"
#include "apps/python/shown_model.hpp"
#include "optim/runs/run_state.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

py::dict parameters_of(const ShownModel& model) {
  py::dict arrays;
  for (const auto& [name, values] : model.host().groups)
    arrays[name.c_str()] = array_of<float>({py::ssize_t(values.size())}, values);
  return arrays;
}

py::dict poses_of(ShownModel& model, double time) {
  Poses poses;
  {
    const py::gil_scoped_release unlocked;
    poses = model.at(time);
  }
  const HostModel& host = model.host();
  const py::ssize_t n = py::ssize_t(host.count);
  const py::ssize_t k = py::ssize_t(host.shape.sh_degree + 1) * (host.shape.sh_degree + 1);
  py::array_t<float> colors(Shape{n, k, 3});
  const std::vector<float>& first = host.groups.at("sh0");
  const std::vector<float>* rest = k > 1 ? &host.groups.at("sh_rest") : nullptr;
  float* to = colors.mutable_data();
  for (py::ssize_t i = 0; i < n; ++i) {
    to = std::copy_n(&first[size_t(3 * i)], 3, to);
    if (rest) to = std::copy_n(&(*rest)[size_t(3 * (k - 1) * i)], 3 * (k - 1), to);
  }
  py::dict arrays;
  arrays["means"] = array_of<float>({n, 3}, poses.means);
  arrays["quats"] = array_of<float>({n, 4}, poses.quats);
  arrays["scales"] = array_of<float>({n, 3}, poses.scales);
  arrays["opacities"] = array_of<float>({n}, poses.opacities);
  arrays["colors"] = colors;
  arrays["sh_degree"] = host.shape.sh_degree;
  return arrays;
}

py::dict pictures_of(ShownModel& model, const py::object& camera, double time,
                     const std::optional<double>& time_t2, const py::object& camera_t2,
                     const std::array<float, 3>& background, const std::optional<float>& near) {
  const Camera first = camera_from(camera);
  const Camera second = camera_t2.is_none() ? first : camera_from(camera_t2);
  Pictures pictures;
  {
    const py::gil_scoped_release unlocked;
    pictures = model.render(first, time, time_t2, second, background, near);
  }
  const py::ssize_t h = first.height, w = first.width;
  py::dict images;
  images["colors"] = array_of<float>({h, w, 3}, pictures.colors);
  images["alphas"] = array_of<float>({h, w, 1}, pictures.alphas);
  images["depth"] = array_of<float>({h, w, 1}, pictures.depth);
  images["flow"] =
      time_t2 ? py::object(array_of<float>({h, w, 2}, pictures.flow)) : py::object(py::none());
  return images;
}

}  // namespace

void bind_models(py::module_& m) {
  py::class_<ShownModel, std::shared_ptr<ShownModel>>(m, "Model")
      .def_static(
          "load",
          [](const std::string& path, std::optional<int> iteration) {
            const py::gil_scoped_release unlocked;
            return std::make_shared<ShownModel>(
                ShownModel::load(path, iteration.value_or(latest_iteration)));
          },
          py::arg("path"), py::arg("iteration"))
      .def(
          "save",
          [](const ShownModel& model, const std::string& path) {
            const py::gil_scoped_release unlocked;
            write_model(path, model.host());
          },
          py::arg("path"))
      .def_property_readonly("count", [](const ShownModel& model) { return model.host().count; })
      .def_property_readonly("moving",
                             [](const ShownModel& model) { return model.host().num_moving(); })
      .def_property_readonly(
          "motion", [](const ShownModel& model) { return name_of(model.host().shape.motion); })
      .def_property_readonly("sh_degree",
                             [](const ShownModel& model) { return model.host().shape.sh_degree; })
      .def_property_readonly("origin",
                             [](const ShownModel& model) { return model.host().shape.origin; })
      .def_property_readonly("near_plane", &ShownModel::near)
      .def_property_readonly("state", &ShownModel::state)
      .def("parameters", &parameters_of)
      .def("at", &poses_of, py::arg("time"))
      .def("render", &pictures_of, py::arg("camera"), py::arg("time"), py::arg("time_t2"),
           py::arg("camera_t2"), py::arg("background"), py::arg("near_plane"));
}

}  // namespace gflow::python
