// SPDX-License-Identifier: Apache-2.0
// The compiled part of the Python package, gflow._core. Its users are gflow/*.py, which have the
// documentation.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "apps/common/checked_device.hpp"
#include "apps/common/options.hpp"
#include "apps/python/bindings.hpp"
#include "apps/python/rasterization.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/cl/environment.hpp"
#include "runtime/files/json_text.hpp"

namespace py = pybind11;

namespace gflow::python {

void check_interrupt() {
  const py::gil_scoped_acquire lock;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

py::object from_json(const nlohmann::ordered_json& json) {
  return py::module_::import("json").attr("loads")(json_text(json));
}

namespace {

py::object devices() {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  {
    const py::gil_scoped_release unlocked;
    check_environment();
    try {
      for (const DeviceInfo& info : list_devices()) list.push_back(as_json(checked(info)));
    } catch (const Error& error) {
      throw NoUsableDevice(error.what());
    }
  }
  return from_json(list);
}

std::string device(const std::string& wanted) {
  const py::gil_scoped_release unlocked;
  if (!wanted.empty()) choose_device(wanted);
  return current_device().queue.info.full_name();
}

// Classes of exceptions, kept until the process ends.
PyObject *error_class, *input_error, *device_error, *memory_error;

// gflow.Error, which `except gflow.Error` catches all by, and those below it, each of which is also
// of the built-in class that fits.
void register_errors(py::module_& m) {
  const auto make = [&](const char* name, const py::tuple& bases) {
    PyObject* made =
        PyErr_NewException(("gflow." + std::string(name)).c_str(), bases.ptr(), nullptr);
    if (!made) throw py::error_already_set();
    m.attr(name) = py::handle(made);
    return made;
  };
  error_class = make("Error", py::make_tuple(py::handle(PyExc_Exception)));
  const auto both = [](PyObject* built_in) {
    return py::make_tuple(py::handle(error_class), py::handle(built_in));
  };
  input_error = make("InputError", both(PyExc_ValueError));
  device_error = make("DeviceError", both(PyExc_RuntimeError));
  memory_error = make("OutOfMemoryError", both(PyExc_MemoryError));
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const InputError& error) {
      PyErr_SetString(input_error, error.what());
    } catch (const Interrupted& stop) {
      PyErr_SetString(PyExc_KeyboardInterrupt, stop.what());
    } catch (const Error& error) {
      const bool device_failed = dynamic_cast<const ClError*>(&error) != nullptr ||
                                 dynamic_cast<const NoUsableDevice*>(&error) != nullptr;
      PyErr_SetString(is_out_of_memory(error) ? memory_error
                      : device_failed         ? device_error
                                              : error_class,
                      error.what());
    }
  });
}

}  // namespace
}  // namespace gflow::python

PYBIND11_MODULE(_core, m) {
  using namespace gflow::python;
  register_errors(m);
  m.def("devices", &devices);
  m.def("device", &device, py::arg("wanted"));
  bind_rasterization(m);
#ifdef GFLOW_WITH_TRAINING
  bind_models(m);
  bind_scenes(m);
  bind_training(m);
#endif
}
