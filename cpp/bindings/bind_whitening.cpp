#include <pybind11/stl.h>

#include <algorithm>
#include <tuple>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/kernels/whitening.hpp"

namespace fisherpoint::bindings {
namespace {

using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;
using Part = std::tuple<std::size_t, double, double>;

std::pair<py::array_t<double>, py::array_t<double>> whiten(const Input& columns, const Input& times, const Input& std,
                                                           const Flags& measured, const Input& correlation,
                                                           const std::vector<Part>& parts, int threads) {
  check_shape(columns, {-1, -1, -1, -1}, "columns");
  const py::ssize_t count = columns.shape(0), samples = columns.shape(1), outputs = columns.shape(2), c = columns.shape(3);
  check_shape(times, {count, samples}, "times");
  check_shape(std, {count, samples, outputs}, "std");
  check_shape(correlation, {outputs, outputs}, "correlation");
  const std::vector<py::ssize_t> flags(measured.shape(), measured.shape() + measured.ndim());
  if (flags != std::vector<py::ssize_t>{count, samples, outputs})
    throw py::value_error("measured: expected the shape of std, given another");
  std::vector<GaussMarkovPart> given;
  for (const auto& [output, of_part, correlation_time] : parts) {
    if (output >= static_cast<std::size_t>(outputs)) throw py::value_error("parts: expected places of outputs, given another");
    given.push_back({output, of_part, correlation_time});
  }
  const auto size = [](py::ssize_t n) { return static_cast<std::size_t>(n); };
  auto white = empty({count, samples, outputs, c}), log_det = empty({count});
  double* const out = white.mutable_data();
  double* const logs = log_det.mutable_data();
  const NoisySequences sequences{size(count), size(samples), size(outputs), size(c), times.data(), std.data(), measured.data()};
  {
    const py::gil_scoped_release released;
    std::copy_n(columns.data(), columns.size(), out);
    const Workers workers(threads, [] {
      const py::gil_scoped_acquire held;
      return PyErr_CheckSignals() != 0;
    });
    try {
      Whitening(size(outputs), correlation.data(), std::move(given)).whiten(sequences, out, logs, workers);
    } catch (const Interrupted&) {
      const py::gil_scoped_acquire held;
      throw py::error_already_set();
    }
  }
  return {white, log_det};
}

}  // namespace

void bind_whitening(py::module_& m) {
  using namespace py::literals;
  m.def("whiten", &whiten, "columns"_a, "times"_a, "std"_a, "measured"_a, "correlation"_a, "parts"_a, "threads"_a = 1,
        "R^-1/2 of columns (K, N, n_y, C), zero where not measured, and log det R (K,): white noise of std (K, N, n_y) and\n"
        "correlation (n_y, n_y), and Gauss-Markov parts (output, std, correlation time).");
}

}  // namespace fisherpoint::bindings
