#include "bindings.hpp"

PYBIND11_MODULE(_core, m) {
  m.doc() = "What the core does once, whatever the instruction set: models, prior nodes, Fisher accumulator.";
  fisherpoint::bindings::bind_models(m);
  fisherpoint::bindings::bind_tape(m);
  fisherpoint::bindings::bind_prior_nodes(m);
  fisherpoint::bindings::bind_fisher(m);
  fisherpoint::bindings::bind_instruction_sets(m);
}
