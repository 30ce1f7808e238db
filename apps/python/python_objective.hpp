// SPDX-License-Identifier: Apache-2.0
// A loss that is a Python object (gflow.Objective): receives the rendered images of each view as
// arrays and returns its value and its gradients by them.
#pragma once
#include "apps/python/bindings.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/train/make_objectives.hpp"

namespace gflow::python {

// Makes the objective in a training. `object` has `name`, `channels` (of "depth" and "flow") and is
// called with a dict; the caller keeps it alive, and has let go of Python's lock.
MakeObjective python_objective(pybind11::handle object);

}  // namespace gflow::python
