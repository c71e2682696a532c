#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "fisherpoint/prior/prior_nodes.hpp"

namespace fisherpoint::bindings {
namespace {

std::vector<double> values_of(const Input& array) { return {array.data(), array.data() + array.size()}; }

auto arrays_of(const Axis& axis) {
  return py::make_tuple(py::array_t<double>(py::cast(axis.values)), py::array_t<double>(py::cast(axis.probabilities)));
}

std::vector<Axis> checked_axes(const std::vector<std::pair<Input, Input>>& axes) {
  std::vector<Axis> checked;
  for (const auto& [values, probabilities] : axes) {
    check_shape(values, {-1}, "axis values");
    check_shape(probabilities, {values.shape(0)}, "axis probabilities");
    if (values.shape(0) == 0) throw py::value_error("axis values: expected at least one, given none");
    checked.push_back({values_of(values), values_of(probabilities)});
  }
  return checked;
}

}  // namespace

void bind_prior_nodes(py::module_& m) {
  using namespace py::literals;
  m.def(
      "cells", [](double mean, double std, int levels, double span) { return arrays_of(cells(mean, std, levels, span)); },
      "mean"_a, "std"_a, "levels"_a, "span"_a, "Values and cell probabilities (13) of one parameter.");
  m.def(
      "cells_between",
      [](const Input& edges) {
        check_shape(edges, {-1}, "edges");
        return arrays_of(cells_between({edges.data(), static_cast<std::size_t>(edges.size())}));
      },
      "edges"_a, "Middles and probabilities of the cells between neighbouring edges, in standard deviations.");

  py::class_<PriorNodes>(m, "PriorNodes", "Weighted nodes that stand for the prior.")
      .def("__len__", &PriorNodes::size)
      .def("nodes",
           [](const PriorNodes& nodes) {
             const auto size = static_cast<py::ssize_t>(nodes.size());
             auto theta = empty({nodes.parameters(), size}), weights = empty({size});
             nodes.read(0, nodes.size(), theta.mutable_data(), weights.mutable_data());
             return py::make_tuple(py::array_t<double>(theta.attr("T").attr("copy")()), weights);
           })
      .def(
          "second_moments",
          [](const PriorNodes& nodes, const Input& mean, const Input& std) {
            check_shape(mean, {nodes.parameters()}, "mean");
            check_shape(std, {nodes.parameters()}, "std");
            auto moments = empty({nodes.parameters(), nodes.parameters()});
            std::ranges::copy(second_moments(nodes, mean.data(), std.data()), moments.mutable_data());
            return moments;
          },
          "mean"_a, "std"_a, "Second moments about the mean in units of std, (p, p).");

  py::class_<PriorGrid, PriorNodes>(m, "PriorGrid", "Tensor product of axes; the last runs fastest.")
      .def(py::init([](const std::vector<std::pair<Input, Input>>& axes) { return PriorGrid(checked_axes(axes)); }), "axes"_a)
      .def(py::init([](const std::vector<std::pair<Input, Input>>& axes, const Input& center, const Input& matrix,
                       const std::vector<bool>& exponential) {
             const auto p = static_cast<py::ssize_t>(axes.size());
             check_shape(center, {p}, "center");
             check_shape(matrix, {p, p}, "matrix");
             if (exponential.size() != axes.size()) throw py::value_error("exponential: expected one for each axis");
             return PriorGrid(checked_axes(axes), Coordinates{values_of(center), values_of(matrix),
                                                              std::vector<char>(exponential.begin(), exponential.end())});
           }),
           "axes"_a, "center"_a, "matrix"_a, "exponential"_a);

  py::class_<NodeTable, PriorNodes>(m, "NodeTable", "Stored nodes, with parameter sets near the edge of what they cover.")
      .def(py::init([](const Input& theta, const Input& weights, const Input& pilots) {
             check_shape(weights, {-1}, "weights");
             check_shape(theta, {weights.shape(0), -1}, "theta");
             check_shape(pilots, {-1, theta.shape(1)}, "pilots");
             return NodeTable(values_of(theta), values_of(weights), values_of(pilots));
           }),
           "theta"_a, "weights"_a, "pilots"_a);
}

}  // namespace fisherpoint::bindings
