#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/compiled/compiled_model.hpp"
#include "fisherpoint/compiled/straight_model.hpp"
#include "fisherpoint/equations/tape_equations.hpp"

namespace fisherpoint::bindings {
namespace {

using Rows = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;

std::vector<Instruction> instructions(const Rows& rows, const char* name) {
  if (rows.ndim() != 2 || rows.shape(1) != 5)
    throw py::value_error(std::string(name) + ": expected rows (operation, out, a, b, c), given another shape");
  std::vector<Instruction> result;
  for (py::ssize_t k = 0; k < rows.shape(0); ++k) {
    const std::int32_t* row = rows.data(k, 0);
    result.push_back({static_cast<Operation>(row[0]), row[1], row[2], row[3], row[4]});
  }
  return result;
}

TapeModel tape_model(const std::vector<double>& scales, int inputs, int outputs, int parameters, int jumps, int kinks,
                     int poles, int limits, int measured, Program rates, Program output, Program surfaces,
                     Program surface_rates, Program state_jacobian, Program rate_jacobian, Program output_jacobian,
                     Program jump_jacobian, const std::vector<std::pair<int, int>>& state_entries,
                     const std::vector<std::pair<int, int>>& rate_entries,
                     const std::vector<std::pair<int, int>>& output_entries,
                     const std::vector<std::pair<int, int>>& jump_entries, std::vector<bool> varying_states,
                     std::vector<bool> varying_outputs, std::vector<bool> varying_surfaces, std::vector<bool> crossable,
                     std::vector<bool> rough, std::vector<bool> steep, std::vector<bool> closed,
                     std::vector<bool> constant_slopes, int reset_count, Program resets, Program reset_jacobian,
                     const std::vector<std::pair<int, int>>& reset_targets,
                     const std::vector<std::pair<int, int>>& reset_entries, std::vector<bool> reset_levels, int update_count,
                     Program updates, Program update_jacobian, const std::vector<std::pair<int, int>>& update_targets,
                     const std::vector<std::pair<int, int>>& update_entries) {
  Shape<TapeModel> shape{
      static_cast<int>(scales.size()),  inputs, outputs, parameters, jumps, jumps + kinks, jumps + kinks + poles,
      jumps + kinks + limits - measured};
  shape.measured = measured;
  shape.sided_limits = detail::reads_sides(surfaces, shape);
  shape.resets = reset_count;
  shape.updates = update_count;
  const auto entries = [](const std::vector<std::pair<int, int>>& pairs) {
    std::vector<Entry> result;
    for (const auto& [row, variable] : pairs) result.push_back({row, variable});
    return result;
  };
  return TapeModel(
      shape, scales,
      {std::move(rates), std::move(output), std::move(surfaces), std::move(surface_rates), std::move(state_jacobian),
       std::move(rate_jacobian), std::move(output_jacobian), std::move(jump_jacobian)},
      entries(state_entries), entries(rate_entries), entries(output_entries), entries(jump_entries),
      {std::move(varying_states), std::move(varying_outputs), std::move(varying_surfaces), std::move(crossable),
       std::move(rough), std::move(steep), std::move(closed), std::move(constant_slopes)},
      {std::move(resets), std::move(reset_jacobian), entries(reset_targets), entries(reset_entries), std::move(reset_levels)},
      {std::move(updates), std::move(update_jacobian), entries(update_targets), entries(update_entries)});
}

using P = Pack<16>;
using Equation = StateEquation<TapeModel, P>;
using Variation = VariationalEquation<TapeModel, P>;

// function(equation, x), with `width` values, for every row; lanes = rows.
template <class E = Equation>
py::array_t<double> map_rows(const TapeModel& model, const Input& x, const Input& u, const Input& theta, int width,
                             const auto& function) {
  const auto& shape = model.shape();
  const py::ssize_t count = x.ndim() == 2 ? x.shape(0) : -1;
  check_shape(x, {count, shape.states}, "x");
  check_shape(u, {count, shape.inputs}, "u");
  check_shape(theta, {count, shape.parameters}, "theta");
  auto result = empty({count, width});
  const py::gil_scoped_release unlocked;
  for (py::ssize_t first = 0; first < count; first += P::width) {
    const auto rows = [&](const Input& of, int n) {
      HeapArray<P> packs(n);
      for (int lane = 0; lane < P::width; ++lane) set_lane(packs, lane, of.data() + std::min(first + lane, count - 1) * n);
      return packs;
    };
    const E equation(model, rows(theta, shape.parameters), rows(u, shape.inputs));
    const HeapArray<P> values = function(equation, rows(x, shape.states));
    for (int lane = 0; lane < P::width && first + lane < count; ++lane)
      for (int i = 0; i < width; ++i) result.mutable_data()[(first + lane) * width + i] = values[i][lane];
  }
  return result;
}

}  // namespace

void bind_tape(py::module_& m) {
  using namespace py::literals;
  m.def(
      "operations", [] { return std::vector<std::string>(std::begin(operation_names), std::end(operation_names)); },
      "Names of what a program can do; their places are the codes.");

  py::class_<Program>(m, "Program")
      .def(py::init([](std::vector<double> literals, const Rows& setup, const Rows& stage, std::vector<std::int32_t> outputs,
                       std::int32_t registers) {
             return Program{std::move(literals), instructions(setup, "setup"), instructions(stage, "stage"), std::move(outputs),
                            registers};
           }),
           "literals"_a, "setup"_a, "stage"_a, "outputs"_a, "registers"_a);

  py::class_<TapeModel>(m, "TapeModel")
      .def(py::init(&tape_model), "scales"_a, "inputs"_a, "outputs"_a, "parameters"_a, "jumps"_a, "kinks"_a, "poles"_a,
           "limits"_a, "measured"_a, "rates"_a, "output"_a, "surfaces"_a, "surface_rates"_a, "state_jacobian"_a,
           "rate_jacobian"_a, "output_jacobian"_a, "jump_jacobian"_a, "state_entries"_a, "rate_entries"_a, "output_entries"_a,
           "jump_entries"_a, "varying_states"_a, "varying_outputs"_a, "varying_surfaces"_a, "crossable"_a, "rough"_a, "steep"_a,
           "closed"_a, "constant_slopes"_a, "reset_count"_a, "resets"_a, "reset_jacobian"_a, "reset_targets"_a,
           "reset_entries"_a, "reset_levels"_a, "update_count"_a, "updates"_a, "update_jacobian"_a, "update_targets"_a,
           "update_entries"_a,
           "Scales of the states, how many there are of what (the poles and what is measured among the limits), and the "
           "programs with their entries.")
      .def(
          "rhs",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows(model, x, u, theta, model.shape().states, [&](const Equation& f, const Equation::State& x) {
              auto side = f.surface_values(x);
              for (P& s : side) s = sign(s);
              Equation::State rates(f.states);
              f.derivative(x, side, rates);
              return rates;
            });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "output",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows(model, x, u, theta, model.shape().outputs,
                            [](const Equation& f, const Equation::State& x) { return f.output(x); });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "updated",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta, std::int32_t which) {
            return map_rows(model, x, u, theta, model.shape().states, [which](const Equation& f, const Equation::State& x) {
              return f.update(x, P(static_cast<double>(which)));
            });
          },
          "x"_a, "u"_a, "theta"_a, "which"_a, "States behind the updates that `which` has as bits.")
      .def(
          "output_jacobian",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta) {
            const auto& shape = model.shape();
            auto slopes = map_rows<Variation>(model, x, u, theta, shape.outputs * shape.parameters,
                                              [](const Variation& equation, const Equation::State& x) {
                                                Columns<TapeModel, P> at_rest(equation.dependence.in_columns);
                                                for (P& entry : at_rest) entry = P(0.0);
                                                Equation::Output y(equation.outputs);
                                                ShelfVector<P> dy_dtheta(equation.outputs * equation.parameters);
                                                equation.output(x, at_rest, y, dy_dtheta);
                                                HeapArray<P> values(equation.outputs * equation.parameters);
                                                std::copy(dy_dtheta.begin(), dy_dtheta.end(), values.begin());
                                                return values;
                                              });
            return slopes.reshape({slopes.shape(0), py::ssize_t{shape.outputs}, py::ssize_t{shape.parameters}});
          },
          "x"_a, "u"_a, "theta"_a, "Derivatives of g by the parameters where the state is held: (K, n_y, p).")
      .def(
          "switching",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows(model, x, u, theta, model.shape().kinks_end,
                            [](const Equation& f, const Equation::State& x) { return f.surface_values(x); });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "limits",
          [](const TapeModel& model, const Input& x, const Input& u, const Input& theta) {
            const auto& shape = model.shape();
            return map_rows(model, x, u, theta, shape.surfaces + shape.measured - shape.kinks_end,
                            [&](const Equation& f, const Equation::State& x) {
                              auto side = f.surface_values(x);
                              for (P& s : side) s = sign(s);
                              const auto all = f.surface_values(x, side);
                              HeapArray<P> limits(f.surfaces + f.measured - f.kinks_end);
                              std::copy(all.begin() + f.kinks_end, all.end(), limits.begin());
                              return limits;
                            });
          },
          "x"_a, "u"_a, "theta"_a);

  py::class_<CompiledModel, TapeModel>(m, "CompiledModel")
      .def(py::init<const TapeModel&, const std::string&>(), "tape"_a, "library"_a);
  py::class_<StraightModel, TapeModel>(m, "StraightModel")
      .def(py::init<const TapeModel&, const std::string&>(), "tape"_a, "library"_a);
}

}  // namespace fisherpoint::bindings
