// SPDX-License-Identifier: Apache-2.0
// NumPy arrays in and out. Python hands over arrays of float in C order; every shape is checked
// here.
#pragma once
#include <pybind11/numpy.h>

#include <string>
#include <vector>

namespace gflow::python {

using FloatArray = pybind11::array_t<float, pybind11::array::c_style>;
using Shape = std::vector<pybind11::ssize_t>;

// The argument of this name; an empty array if it is None or absent. TypeError if it is not an
// array of float32 in C order.
FloatArray argument(const pybind11::dict& arguments, const char* name);
// Its values. InputError if it has another shape or is absent.
const float* values(const FloatArray& array, const Shape& shape, const char* name);
// InputError: the array has this shape, `expected` says which it should have.
[[noreturn]] void refuse_shape(const pybind11::array& array, const char* name,
                               const std::string& expected);

// A new array, which owns its memory. Values are undefined.
template <class T = float>
pybind11::array_t<T> new_array(const Shape& shape) {
  return pybind11::array_t<T>(shape);
}

}  // namespace gflow::python
