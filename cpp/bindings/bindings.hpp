// One function per concept; module.cpp calls them.
#pragma once

#include <pybind11/pybind11.h>

namespace fisherpoint::bindings {

void bind_models(pybind11::module_& m);
void bind_tape(pybind11::module_& m);
void bind_prior_nodes(pybind11::module_& m);
void bind_fisher(pybind11::module_& m);
void bind_whitening(pybind11::module_& m);

}  // namespace fisherpoint::bindings
