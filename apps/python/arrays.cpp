// SPDX-License-Identifier: Apache-2.0
#include "apps/python/arrays.hpp"

#include "apps/python/rasterization.hpp"

namespace py = pybind11;

namespace gflow::python {
namespace {

std::string text_of(const py::ssize_t* sides, size_t count) {
  std::string text = "(";
  for (size_t i = 0; i < count; ++i) text += (i ? ", " : "") + std::to_string(sides[i]);
  return text + (count == 1 ? ",)" : ")");
}

}  // namespace

FloatArray argument(const py::dict& arguments, const char* name) {
  if (!arguments.contains(name) || arguments[name].is_none()) return FloatArray(Shape{0});
  const py::object value = arguments[name];
  if (!py::isinstance<FloatArray>(value))
    throw py::type_error(
        fmt::format("rasterization: argument '{}' is not an array of float32 in C order", name));
  return py::reinterpret_borrow<FloatArray>(value);
}

void refuse_shape(const py::array& array, const char* name, const std::string& expected) {
  throw InputError(fmt::format("rasterization: argument '{}' has shape {}, expected {}", name,
                               text_of(array.shape(), size_t(array.ndim())), expected));
}

const float* values(const FloatArray& array, const Shape& shape, const char* name) {
  const bool same = array.ndim() == py::ssize_t(shape.size()) &&
                    std::equal(shape.begin(), shape.end(), array.shape());
  if (!same) refuse_shape(array, name, text_of(shape.data(), shape.size()));
  return array.data();
}

}  // namespace gflow::python
