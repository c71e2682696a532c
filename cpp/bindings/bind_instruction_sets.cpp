#include <pybind11/stl.h>

#include <string>
#include <vector>

#include "bindings.hpp"

namespace fisherpoint::bindings {

void bind_instruction_sets(pybind11::module_& m) {
  m.def(
      "supported_isas",
      [] {
#if defined(__x86_64__)
        std::vector<std::string> names;
        if (__builtin_cpu_supports("x86-64-v2")) names.push_back("v2");
        if (__builtin_cpu_supports("x86-64-v3")) names.push_back("v3");
        if (__builtin_cpu_supports("x86-64-v4")) names.push_back("v4");
        return names;
#else
        return std::vector<std::string>{"generic"};
#endif
      },
      "Instruction-set levels that this machine has, the best last.");
}

}  // namespace fisherpoint::bindings
