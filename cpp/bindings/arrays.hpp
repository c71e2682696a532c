// NumPy arrays in and out of the bindings: checked shapes in, fresh arrays out.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <initializer_list>
#include <string>
#include <vector>

namespace fisherpoint::bindings {

namespace py = pybind11;
using Input = py::array_t<double, py::array::c_style | py::array::forcecast>;

inline std::string shape_text(const std::vector<py::ssize_t>& shape) {
  std::string text = "(";
  for (const auto n : shape) text += (n < 0 ? std::string("any") : std::to_string(n)) + ", ";
  return text + ")";
}

// -1 in `expected` takes any size.
inline void check_shape(const Input& array, const std::vector<py::ssize_t>& expected, const char* name) {
  const std::vector<py::ssize_t> given(array.shape(), array.shape() + array.ndim());
  bool same = given.size() == expected.size();
  for (std::size_t i = 0; same && i < given.size(); ++i) same = expected[i] < 0 || given[i] == expected[i];
  if (!same)
    throw py::value_error(std::string(name) + ": expected shape " + shape_text(expected) + ", given " + shape_text(given));
}

inline py::array_t<double> empty(std::initializer_list<py::ssize_t> shape) {
  return py::array_t<double>(std::vector<py::ssize_t>(shape));
}

}  // namespace fisherpoint::bindings
