// SPDX-License-Identifier: Apache-2.0
// The parts of the compiled module gflow._core, and what they share.
#pragma once
#include <nlohmann/json.hpp>

#include "apps/python/arrays.hpp"

namespace gflow::python {

// Each adds its classes and functions.
void bind_rasterization(pybind11::module_& m);
void bind_models(pybind11::module_& m);  // these need OpenCV
void bind_scenes(pybind11::module_& m);
void bind_training(pybind11::module_& m);

// Raises what Ctrl-C asks for. Called without Python's lock.
void check_interrupt();

// A JSON value as Python objects: dict, list, str, numbers, None.
pybind11::object from_json(const nlohmann::ordered_json& json);

}  // namespace gflow::python
