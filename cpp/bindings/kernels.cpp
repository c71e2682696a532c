// The kernels of one instruction set as a Python module: checks shapes, releases the interpreter lock, computes. Each
// instruction set is a shared object of its own, because inline functions compiled for two of them and linked together would be
// merged, and the baseline would run instructions that the machine may lack.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "fisherpoint/compiled/compiled_model.hpp"
#include "fisherpoint/kernels/column_division.hpp"
#include "fisherpoint/kernels/kernel_models.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/runs.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"

namespace fisherpoint::bindings {
namespace {

using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;
using Columns = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;

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
Runs checked_runs(const M& model, const Input& x0, const Input& u, const Input& dt, const Columns& updates) {
  const py::ssize_t n_u = shape_of(model).inputs, count = x0.ndim() == 2 ? x0.shape(0) : -1;
  const bool shared = dt.ndim() == 1;
  const py::ssize_t segments = dt.ndim() > 0 ? dt.shape(dt.ndim() - 1) : -1;
  check_shape(x0, {count, shape_of(model).states}, "x0");
  if (shared) {
    check_shape(dt, {segments}, "dt");
    check_shape(u, {segments, n_u}, "u");
  } else {
    check_shape(dt, {count, segments}, "dt");
    check_shape(u, {count, segments, n_u}, "u");
  }
  const bool some = updates.size() > 0;
  if (some && !std::equal(updates.shape(), updates.shape() + updates.ndim(), dt.shape(), dt.shape() + dt.ndim()))
    throw py::value_error("updates: expected one number for every segment");
  return {static_cast<std::size_t>(count), static_cast<std::size_t>(segments), x0.data(), u.data(), dt.data(), shared,
          some ? updates.data() : nullptr};
}

template <class M>
Parameters checked_parameters(const M& model, const Input& theta, py::ssize_t count) {
  const py::ssize_t p = shape_of(model).parameters;
  if (theta.ndim() == 2) check_shape(theta, {count, p}, "theta");
  if (theta.ndim() != 2) check_shape(theta, {p}, "theta");
  return {theta.data(), theta.ndim() == 2};
}

MovedSwitches checked_switches(const Columns& moved, const Input& moved_u, py::ssize_t count, py::ssize_t segments,
                               const auto& shape) {
  if (moved.size() == 0) return {};
  const py::ssize_t each = moved.ndim() == 3 ? moved.shape(2) : -1;
  if (each < 0 || moved.shape(0) != count || moved.shape(1) != segments)
    throw py::value_error("moved: expected columns for every segment");
  check_shape(moved_u, {count, segments, each, shape.inputs}, "moved_u");
  const std::int32_t p = shape.parameters;
  for (py::ssize_t at = 0; at < moved.size(); ++at)
    if (moved.data()[at] >= p) throw py::value_error("moved: expected columns of parameters, given one beyond them");
  return {static_cast<std::size_t>(each), moved.data(), moved_u.data()};
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
        auto lasted = empty({count});
        py::array_t<std::int32_t> status(count);
        const Trajectories out{x.mutable_data(), y.mutable_data(), reinterpret_cast<Status*>(status.mutable_data()),
                               lasted.mutable_data()};
        run(threads, [&](const Workers& workers) {
          simulate(model, points, parameters, tolerance_of(rtol, cross_kinks, cross_jumps, method), workers, out);
        });
        return py::make_tuple(x, y, status, lasted);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "x, y, statuses, and until when the trajectories could be followed.");

  m.def(
      "sensitivities",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads, bool whole_first, bool outputs_alone, bool states_later) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const Points points = checked_points(model, x0, u, dt);
        const auto count = static_cast<py::ssize_t>(points.count);
        const Parameters parameters = checked_parameters(model, theta, count);
        auto x = empty({count, n_x}), y = empty({count, n_y}), dy = empty({count, n_y, p});
        const bool without = outputs_alone || (states_later && takes_rows(model));
        auto dx = empty({without ? 0 : count, n_x, p});
        py::array_t<std::int32_t> status(count);
        const SensitiveTrajectories out{x.mutable_data(),
                                        y.mutable_data(),
                                        without ? nullptr : dx.mutable_data(),
                                        dy.mutable_data(),
                                        reinterpret_cast<Status*>(status.mutable_data()),
                                        states_later};
        Tolerance tolerance = tolerance_of(rtol, cross_kinks, cross_jumps, method);
        tolerance.whole_first = whole_first;
        run(threads, [&](const Workers& workers) { sensitivities(model, points, parameters, tolerance, workers, out); });
        return py::make_tuple(x, y, dx, dy, status);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "whole_first"_a = false, "outputs_alone"_a = false, "states_later"_a = false,
      "x, y, dx_dtheta, dy_dtheta and statuses; with `outputs_alone` no dx_dtheta, in less time; with `states_later` none "
      "where "
      "that takes less time, and the statuses of those that have one.");

  m.def(
      "simulate_runs",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads, const Columns& updates) {
        const py::ssize_t n_x = sizes_of(model)[0];
        const Runs runs = checked_runs(model, x0, u, dt, updates);
        const auto count = static_cast<py::ssize_t>(runs.count), segments = static_cast<py::ssize_t>(runs.segments);
        const Parameters parameters = checked_parameters(model, theta, count);
        auto x = empty({count, segments + 1, n_x});
        py::array_t<std::int32_t> status(count);
        py::array_t<std::int64_t> reached(count);
        const RunStates out{x.mutable_data(), reinterpret_cast<Status*>(status.mutable_data()), reached.mutable_data()};
        run(threads, [&](const Workers& workers) {
          simulate_runs(model, runs, parameters, tolerance_of(rtol, cross_kinks, cross_jumps, method), workers, out);
        });
        return py::make_tuple(x, status, reached);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "updates"_a = Columns(),
      "States (K, N + 1, n_x) of runs with the starts x0 (K, n_x) under the inputs u (K, N, n_u), each held for its dt (K, N), "
      "or of u (N, n_u) and dt (N,) that all share; statuses, and how many segments were completed. updates, as dt: those of "
      "the model that come at the segments' starts, as bits.");

  m.def(
      "run_sensitivities",
      [](const M& model, const Input& x0, const Input& u, const Input& dt, const Input& theta, double rtol, bool cross_kinks,
         bool cross_jumps, const std::string& method, int threads, const Flags& measured, const Input& s, bool outputs_alone,
         bool doubts, const Columns& moved, const Input& moved_u, const Columns& updates, bool whole_first) {
        const auto [n_x, n_y, p] = sizes_of(model);
        const Runs runs = checked_runs(model, x0, u, dt, updates);
        const auto count = static_cast<py::ssize_t>(runs.count), segments = static_cast<py::ssize_t>(runs.segments);
        const Parameters parameters = checked_parameters(model, theta, count);
        if (measured.ndim() != 2 || measured.shape(0) != count || measured.shape(1) != segments)
          throw py::value_error("measured: expected a flag for every segment");
        if (s.size() > 0) check_shape(s, {count, n_x, p}, "s");
        const MovedSwitches switches = checked_switches(moved, moved_u, count, segments, shape_of(model));
        auto x = empty({count, segments + 1, n_x}), y = empty({count, segments, n_y}), dy = empty({count, segments, n_y, p});
        auto dx = empty({outputs_alone ? 0 : count, segments, n_x, p});
        py::array_t<std::int32_t> status(count);
        py::array_t<std::int64_t> reached(count);
        const RunStart start{s.size() > 0 ? s.data() : nullptr, reinterpret_cast<const unsigned char*>(measured.data()),
                             switches, doubts};
        const SensitiveRuns out{x.mutable_data(),
                                y.mutable_data(),
                                outputs_alone ? nullptr : dx.mutable_data(),
                                dy.mutable_data(),
                                reinterpret_cast<Status*>(status.mutable_data()),
                                reached.mutable_data()};
        Tolerance tolerance = tolerance_of(rtol, cross_kinks, cross_jumps, method);
        tolerance.whole_first = whole_first;
        run(threads,
            [&](const Workers& workers) { run_sensitivities(model, runs, start, parameters, tolerance, workers, out); });
        return py::make_tuple(x, y, dx, dy, status, reached);
      },
      "model"_a, "x0"_a, "u"_a, "dt"_a, "theta"_a, "rtol"_a, "cross_kinks"_a, "cross_jumps"_a, "method"_a, "threads"_a,
      "measured"_a, "s"_a, "outputs_alone"_a = false, "doubts"_a = false, "moved"_a = Columns(), "moved_u"_a = Input(),
      "updates"_a = Columns(), "whole_first"_a = false,
      "x, y, dx_dtheta, dy_dtheta at the segments' ends, statuses, segments that were completed. s is dx_dtheta at the starts, "
      "empty for zero; at an end that is not `measured` no derivative need exist. With `doubts`, entries of dx_dtheta are NaN "
      "that hang on whether a jump is met before an end or behind it. At the start of a segment the input may switch in "
      "instants "
      "that are parameters: moved (K, N, E) has their columns, -1 for none, and moved_u (K, N, E, n_u) the inputs before. "
      "updates are as of simulate_runs.");

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

void bind_columns(py::module_& m) {
  using namespace py::literals;

  const auto checked = [](const Input& factor, const Input& columns) {
    const py::ssize_t p = factor.ndim() == 2 ? factor.shape(0) : -1;
    check_shape(factor, {p, p}, "factor");
    check_shape(columns, {p, -1, -1}, "columns");
    return CandidateColumns{static_cast<int>(p), static_cast<int>(columns.shape(1)), static_cast<std::size_t>(columns.shape(2)),
                            columns.data()};
  };
  m.def(
      "divided",
      [checked](const Input& factor, const Input& columns) {
        const CandidateColumns of = checked(factor, columns);
        auto result = empty({columns.shape(0), columns.shape(1), columns.shape(2)});
        double* const out = result.mutable_data();
        const py::gil_scoped_release unlocked;
        divide_columns(of, factor.data(), out);
        return result;
      },
      "factor"_a, "columns"_a, "L^-1 W of columns (p, n, N), side by side; L (p, p) is a lower triangle.");
  m.def(
      "determinant_gains",
      [checked](const Input& factor, const Input& columns) {
        const CandidateColumns of = checked(factor, columns);
        auto result = empty({columns.shape(2)});
        double* const out = result.mutable_data();
        const py::gil_scoped_release unlocked;
        determinant_gains(of, factor.data(), out);
        return result;
      },
      "factor"_a, "columns"_a, "det(F + W W^T) / det F (N,) of columns (p, n, N), with F = L L^T.");
}

}  // namespace
}  // namespace fisherpoint::bindings

PYBIND11_MODULE(FISHERPOINT_MODULE, m, pybind11::mod_gil_not_used()) {
  pybind11::module_::import("fisherpoint.engine._core");  // registers the types that the kernels take
  fisherpoint::bindings::bind_model<fisherpoint::HydraulicCylinder>(m);
  fisherpoint::bindings::bind_model<fisherpoint::CompiledModel>(m);  // before the tape, which it is too
  fisherpoint::bindings::bind_model<fisherpoint::TapeModel>(m);
  fisherpoint::bindings::bind_columns(m);
}
