#include <pybind11/stl.h>

#include "bindings.hpp"
#include "fisherpoint/kernels/supported_levels.hpp"

namespace fisherpoint::bindings {

void bind_instruction_sets(pybind11::module_& m) {
  m.def("supported_isas", &supported_levels, "Instruction-set levels that this machine has, the best last.");
}

}  // namespace fisherpoint::bindings
