// SPDX-License-Identifier: Apache-2.0
// Cameras as Python objects: gflow.Camera in, its fields out.
#pragma once
#include "apps/python/bindings.hpp"
#include "optim/scene/camera.hpp"

namespace gflow::python {

// From an object with viewmat [4, 4], K [3, 3] (arrays of float64), width, height and name.
Camera camera_from(const pybind11::object& object);
// The fields of a gflow.Camera.
pybind11::dict fields_of(const Camera& camera);

// An array of this shape with these values.
template <class T, class U = T>
pybind11::array_t<T> array_of(const Shape& shape, const std::vector<U>& values) {
  pybind11::array_t<T> array(shape);
  std::copy(values.begin(), values.end(), array.mutable_data());
  return array;
}

}  // namespace gflow::python
