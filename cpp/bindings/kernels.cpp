// The kernels of one instruction set as a Python module: checks shapes, releases the interpreter lock, computes. Each
// instruction set is a shared object of its own, because inline functions compiled for two of them and linked together would be
// merged, and the baseline would run instructions that the machine may lack.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "fisherpoint/compiled/compiled_model.hpp"
#include "fisherpoint/kernels/kernel_models.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/records.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"

namespace fisherpoint::bindings {
namespace {

// Runs without the interpreter lock; a pending signal's exception (Ctrl-C) is raised once the work has stopped.
void run(int threads, const std::function<void(const Workers&)>& work) {
  try {
    const py::gil_scoped_release unlocked;
    work(Workers(threads, [] {
      const py::gil_scoped_acquire locked;
      return PyErr_CheckSignals() != 0;
    }));
  } catch (const Interrupted&) {
    throw py::error_already_set();
  }
}

Tolerance tolerance_of(double rtol, bool cross_kinks, bool cross_jumps, const std::string& method) {
  Tolerance tolerance{.relative = rtol, .cross_kinks = cross_kinks, .cross_jumps = cross_jumps};
  if (method == "RK45")
    tolerance.method = MethodName::RK45;
  else if (method == "DOP853")
    tolerance.method = MethodName::DOP853;
  else if (method == "Radau")
    tolerance.method = MethodName::Radau;
  else if (method != "fastest")
    throw py::value_error("method: expected RK45, DOP853, Radau or fastest, given " + method);
  return tolerance;
}

// Numbers of states, outputs and parameters.
template <class M>
std::array<py::ssize_t, 3> sizes_of(const M& model) {
  const auto& shape = shape_of(model);
  return {shape.states, shape.outputs, shape.parameters};
}

template <class M>
Points checked_points(const M& model, const Input& x0, const Input& u, const Input& dt) {
  const py::ssize_t count = dt.ndim() == 1 ? dt.shape(0) : -1;
  check_shape(dt, {-1}, "dt");
  check_shape(x0, {count, shape_of(model).states}, "x0");
  check_shape(u, {count, shape_of(model).inputs}, "u");
  return {static_cast<std::size_t>(count), x0.data(), u.data(), dt.data()};
}

template <class M>
Parameters checked_parameters(const M& model, const Input& theta, py::ssize_t count) {
  const py::ssize_t p = shape_of(model).parameters;
  if (theta.ndim() == 2) check_shape(theta, {count, p}, "theta");
  if (theta.ndim() != 2) check_shape(theta, {p}, "theta");
  return {theta.data(), theta.ndim() == 2};
}

template <class M>
void bind_model(py::module_& m) {
  using namespace py::literals;

  m.def(
      "simulate",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const Points points = checked_points(model, x0, u, dt);
        const auto count = static_cast<py::ssize_t>(points.count);
        const Parameters parameters = checked_parameters(model, theta, count);
        auto x = empty({count, n_x}), y = empty({count, n_y});
        py::array_t<std::int32_t> status(count);
        const Trajectories out{x.mutable_data(), y.mutable_data(), reinterpret_cast<Status*>(status.mutable_data())};
        run(threads, [&](const Workers& workers) {
          simulate(model, points, parameters, tolerance_of(rtol, cross_kinks, cross_jumps, method), workers, out);
        });
        return py::make_tuple(x, y, status);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a);

  m.def(
      "sensitivities",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads, bool whole_first, bool outputs_alone) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const Points points = checked_points(model, x0, u, dt);
        const auto count = static_cast<py::ssize_t>(points.count);
        const Parameters parameters = checked_parameters(model, theta, count);
        auto x = empty({count, n_x}), y = empty({count, n_y}), dy = empty({count, n_y, p});
        auto dx = empty({outputs_alone ? 0 : count, n_x, p});
        py::array_t<std::int32_t> status(count);
        const SensitiveTrajectories out{x.mutable_data(), y.mutable_data(), outputs_alone ? nullptr : dx.mutable_data(),
                                        dy.mutable_data(), reinterpret_cast<Status*>(status.mutable_data())};
        Tolerance tolerance = tolerance_of(rtol, cross_kinks, cross_jumps, method);
        tolerance.whole_first = whole_first;
        run(threads, [&](const Workers& workers) { sensitivities(model, points, parameters, tolerance, workers, out); });
        return py::make_tuple(x, y, dx, dy, status);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "whole_first"_a = false, "outputs_alone"_a = false,
      "x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time.");

  m.def(
      "simulate_records",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const py::ssize_t count = x0.ndim() == 2 ? x0.shape(0) : -1, pieces = dt.ndim() == 1 ? dt.shape(0) : -1;
        check_shape(x0, {count, n_x}, "x0");
        check_shape(dt, {-1}, "dt");
        check_shape(u, {pieces, shape_of(model).inputs}, "u");
        const Points records{static_cast<std::size_t>(count), x0.data(), u.data(), dt.data()};
        const Parameters parameters = checked_parameters(model, theta, count);
        auto x = empty({count, pieces + 1, n_x});
        py::array_t<std::int32_t> status(count);
        py::array_t<std::int64_t> reached(count);
        const RecordStates out{x.mutable_data(), reinterpret_cast<Status*>(status.mutable_data()), reached.mutable_data()};
        run(threads, [&](const Workers& workers) {
          simulate_records(model, records, static_cast<std::size_t>(pieces), parameters,
                           tolerance_of(rtol, cross_kinks, cross_jumps, method), workers, out);
        });
        return py::make_tuple(x, status, reached);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "States (B, pieces + 1, n_x) of records with the starts x0 (B, n_x) under the inputs u (pieces, n_u), each held for its "
      "dt "
      "(pieces,); statuses, and how many pieces were completed. A jump ends a record.");

  m.def(
      "predictive_covariance",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& nominal, const PriorNodes& nodes,
         double rtol, bool cross_kinks, bool cross_jumps, const std::string& method, int threads, double max_lost,
         bool keep_outputs) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const Points points = checked_points(model, x0, u, dt);
        const auto count = static_cast<py::ssize_t>(points.count);
        check_shape(nominal, {p}, "theta");
        if (nodes.parameters() != p)
          throw py::value_error("nodes: expected " + std::to_string(p) + " parameters, given " +
                                std::to_string(nodes.parameters()));
        auto covariance = empty({count, n_y, n_y}), lost = empty({count});
        py::array_t<std::int32_t> status(count);
        py::array_t<std::int64_t> redone(count);
        auto y = empty({count, keep_outputs ? static_cast<py::ssize_t>(nodes.size()) : 0, n_y});
        const PredictiveCovariances out{covariance.mutable_data(), reinterpret_cast<Status*>(status.mutable_data()),
                                        redone.mutable_data(), lost.mutable_data(), keep_outputs ? y.mutable_data() : nullptr};
        run(threads, [&](const Workers& workers) {
          predictive_covariance(model, points, nominal.data(), nodes, max_lost,
                                tolerance_of(rtol, cross_kinks, cross_jumps, method), workers, out);
        });
        return py::make_tuple(covariance, status, redone, y, lost);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "nodes"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a,
      "threads"_a, "max_lost"_a = 0.0, "keep_outputs"_a = false,
      "Predictive covariances, statuses, nodes for which the planned steps did not do, outputs (K, R, n_y) where kept, and the "
      "lost shares of the absolute weight.");
}

}  // namespace
}  // namespace fisherpoint::bindings

PYBIND11_MODULE(FISHERPOINT_MODULE, m) {
  pybind11::module_::import("fisherpoint.engine._core");  // registers the types that the kernels take
  fisherpoint::bindings::bind_model<fisherpoint::HydraulicCylinder>(m);
  fisherpoint::bindings::bind_model<fisherpoint::CompiledModel>(m);  // before the tape, which it is too
  fisherpoint::bindings::bind_model<fisherpoint::TapeModel>(m);
}
