#include <pybind11/stl.h>

#include "bindings.hpp"
#include "fisherpoint/kernels/supported_levels.hpp"

PYBIND11_MODULE(_core, m, pybind11::mod_gil_not_used()) {
  m.doc() = "What the core does once, whatever the instruction set: models, prior nodes, Fisher accumulator.";
  fisherpoint::bindings::bind_models(m);
  fisherpoint::bindings::bind_tape(m);
  fisherpoint::bindings::bind_prior_nodes(m);
  fisherpoint::bindings::bind_fisher(m);
  fisherpoint::bindings::bind_whitening(m);
  m.def("supported_isas", &fisherpoint::supported_levels, "Instruction-set levels that this machine has, the best last.");
}
