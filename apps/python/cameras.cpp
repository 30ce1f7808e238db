// SPDX-License-Identifier: Apache-2.0
#include "apps/python/cameras.hpp"

#include <fmt/format.h>

#include "apps/python/rasterization.hpp"
#include "optim/engine/splat_inputs.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

Doubles matrix(const py::object& object, const char* name, py::ssize_t side) {
  const auto array = py::cast<Doubles>(object.attr(name));
  if (array.ndim() != 2 || array.shape(0) != side || array.shape(1) != side)
    throw InputError(fmt::format("a camera's {} is not a matrix of {} x {}", name, side, side));
  return array;
}

}  // namespace

Camera camera_from(const py::object& object) {
  const Doubles viewmat = matrix(object, "viewmat", 4), k = matrix(object, "K", 3);
  Camera camera;
  camera.name = py::cast<std::string>(object.attr("name"));
  camera.width = py::cast<int>(object.attr("width"));
  camera.height = py::cast<int>(object.attr("height"));
  camera.viewmat = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(viewmat.data());
  camera.fx = k.at(0, 0);
  camera.fy = k.at(1, 1);
  camera.cx = k.at(0, 2);
  camera.cy = k.at(1, 2);
  // The rules of rasterization's cameras.
  std::vector<float> pose(viewmat.data(), viewmat.data() + 16), intrinsics(k.data(), k.data() + 9);
  const InputSource source{"reading a camera", "field"};
  try {
    camera_of({pose.data(), 16}, "viewmat", {intrinsics.data(), 9}, "K", camera.width,
              camera.height, 0.f, source);
    require_image_size(camera.width, camera.height, "width, height", source);
  } catch (const Error& problem) {
    throw InputError(problem.what());
  }
  return camera;
}

py::dict fields_of(const Camera& camera) {
  py::array_t<double> viewmat(Shape{4, 4}), k(Shape{3, 3});
  for (int row = 0; row < 4; ++row)
    for (int col = 0; col < 4; ++col) viewmat.mutable_at(row, col) = camera.viewmat(row, col);
  const double values[] = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  std::copy(values, values + 9, k.mutable_data());
  py::dict fields;
  fields["viewmat"] = viewmat;
  fields["K"] = k;
  fields["width"] = camera.width;
  fields["height"] = camera.height;
  fields["name"] = camera.name;
  return fields;
}

}  // namespace gflow::python
