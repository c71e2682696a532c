#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/prior_grid.hpp"

namespace fisherpoint::bindings {

void bind_prior_grid(py::module_& m) {
  using namespace py::literals;
  m.def(
      "cells",
      [](double mean, double std, int levels, double span) {
        const Axis axis = cells(mean, std, levels, span);
        return py::make_tuple(py::array_t<double>(py::cast(axis.values)), py::array_t<double>(py::cast(axis.probabilities)));
      },
      "mean"_a, "std"_a, "levels"_a, "span"_a, "Values and cell probabilities (13) of one parameter.");

  py::class_<PriorGrid>(m, "PriorGrid", "Tensor product of axes; the last runs fastest.")
      .def(py::init([](const std::vector<std::pair<Input, Input>>& axes) {
             std::vector<Axis> checked;
             for (const auto& [values, probabilities] : axes) {
               check_shape(values, {-1}, "axis values");
               check_shape(probabilities, {values.shape(0)}, "axis probabilities");
               if (values.shape(0) == 0) throw py::value_error("axis values: expected at least one, given none");
               checked.push_back({{values.data(), values.data() + values.size()},
                                  {probabilities.data(), probabilities.data() + probabilities.size()}});
             }
             return PriorGrid(std::move(checked));
           }),
           "axes"_a)
      .def("__len__", &PriorGrid::size)
      .def("nodes", [](const PriorGrid& grid) {
        const auto size = static_cast<py::ssize_t>(grid.size());
        auto theta = empty({size, grid.parameters()}), weights = empty({size});
        PriorGrid::Cursor node(grid, 0);
        for (py::ssize_t r = 0; r < size; ++r, node.advance()) {
          std::copy_n(node.theta(), grid.parameters(), theta.mutable_data(r, 0));
          *weights.mutable_data(r) = node.probability();
        }
        return py::make_tuple(theta, weights);
      });
}

}  // namespace fisherpoint::bindings
