// The state equation and the variational equation (9) of a tape (tape.hpp), as the integrator takes them.
#pragma once

#include "functions.hpp"
#include "points.hpp"
#include "sensitivity.hpp"
#include "state_equation.hpp"
#include "tape.hpp"

namespace fisherpoint {

// A program with the registers that it works on.
template <class P>
class Machine {
 public:
  using Array = HeapArray<P>;

  Machine(const Program& program, const Shape<TapeModel>& shape, const Array& theta, const Array& u)
      : program_(program), registers_(program.registers) {
    x_ = std::copy(
        u.begin(), u.end(),
        std::copy(theta.begin(), theta.end(), std::copy(program.literals.begin(), program.literals.end(), registers_.data())));
    side_ = x_ + shape.states;
    dx_ = side_ + shape.kinks_end;
    carry_out(program.setup, registers_.data());
  }

  void run(const Array& x) {
    std::copy(x.begin(), x.end(), x_);
    carry_out(program_.stage, registers_.data());
  }
  void run(const Array& x, const Array& side) {
    std::copy(side.begin(), side.begin() + (dx_ - side_), side_);
    run(x);
  }
  void run_along(const Array& x, const Array& dx) {
    std::copy(dx.begin(), dx.end(), dx_);
    run(x);
  }

  const P& output(int i) const { return registers_[program_.outputs[i]]; }

 private:
  [[gnu::noinline]] static void carry_out(const std::vector<Instruction>& instructions, P* r) {
    using O = Operation;
    for (const auto [operation, out, a, b, c] : instructions) {
      switch (operation) {
        case O::add:
          r[out] = r[a] + r[b];
          break;
        case O::sub:
          r[out] = r[a] - r[b];
          break;
        case O::mul:
          r[out] = r[a] * r[b];
          break;
        case O::div:
          r[out] = r[a] / r[b];
          break;
        case O::neg:
          r[out] = -r[a];
          break;
        case O::mul_add:
          r[out] = r[a] * r[b] + r[c];
          break;
        case O::mul_sub:
          r[out] = r[a] * r[b] - r[c];
          break;
        case O::sub_mul:
          r[out] = r[c] - r[a] * r[b];
          break;
        case O::sqrt:
          r[out] = sqrt(r[a]);
          break;
        case O::exp:
          r[out] = each_lane(r[a], std::exp);
          break;
        case O::log:
          r[out] = each_lane(r[a], std::log);
          break;
        case O::sin:
          r[out] = each_lane(r[a], std::sin);
          break;
        case O::cos:
          r[out] = each_lane(r[a], std::cos);
          break;
        case O::tan:
          r[out] = each_lane(r[a], std::tan);
          break;
        case O::asin:
          r[out] = each_lane(r[a], std::asin);
          break;
        case O::acos:
          r[out] = each_lane(r[a], std::acos);
          break;
        case O::atan:
          r[out] = each_lane(r[a], std::atan);
          break;
        case O::sinh:
          r[out] = each_lane(r[a], std::sinh);
          break;
        case O::cosh:
          r[out] = each_lane(r[a], std::cosh);
          break;
        case O::tanh:
          r[out] = each_lane(r[a], std::tanh);
          break;
        case O::pow:
          r[out] = power(r[a], r[b]);
          break;
        case O::abs:
          r[out] = abs(r[a]);
          break;
        case O::sign:
          r[out] = sign(r[a]);
          break;
        case O::min:
          r[out] = min(r[a], r[b]);
          break;
        case O::max:
          r[out] = max(r[a], r[b]);
          break;
        case O::select:
          r[out] = select(r[a] > P(0.0), r[b], r[c]);
          break;
        case O::copy:
          r[out] = r[a];
          break;
        case O::count:
          break;
      }
    }
  }

  const Program& program_;
  Array registers_;
  P *x_, *side_, *dx_;  // places of these leaves
};

template <class P>
class StateEquation<TapeModel, P> : public Shape<TapeModel> {
  using Array = HeapArray<P>;

 public:
  using Number = P;
  using State = Array;
  using Side = Array;
  using Surfaces = Array;
  using Theta = Array;
  using Input = Array;
  using Output = Array;

  // `model` must outlive the equation.
  StateEquation(const TapeModel& model, const Theta& theta, const Input& u)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        rates_(model.programs().rates, model.shape(), theta, u),
        output_(model.programs().output, model.shape(), theta, u),
        surfaces_(model.programs().surfaces, model.shape(), theta, u),
        surface_rates_(model.programs().surface_rates, model.shape(), theta, u) {}

  const Dependence<TapeModel>& dependence;

  void derivative(const State& x, const Side& side, State& dx) const {
    rates_.run(x, side);
    for (int i = 0; i < states; ++i) dx[i] = rates_.output(i);
  }
  Output output(const State& x) const {
    output_.run(x);
    return outputs_of(output_, outputs);
  }

  P squared_size(const State& x) const {
    P sum(0.0);
    for (int i = 0; i < states; ++i) {
      const P relative = x[i] * model_.inverse_scale(i);
      sum += relative * relative;
    }
    return sum;
  }

  Surfaces surface_values(const State& x) const {
    surfaces_.run(x);
    return outputs_of(surfaces_, surfaces);
  }
  Surfaces surface_rates(const State& x, const State& dx) const {
    surface_rates_.run_along(x, dx);
    return outputs_of(surface_rates_, surfaces);
  }

 private:
  static Array outputs_of(const Machine<P>& machine, int n) {
    Array values(n);
    for (int i = 0; i < n; ++i) values[i] = machine.output(i);
    return values;
  }

  const TapeModel& model_;
  mutable Machine<P> rates_, output_, surfaces_, surface_rates_;  // each with its own registers: not for two threads
};

template <class P>
class VariationalEquation<TapeModel, P> : public Shape<TapeModel> {
  using Plain = StateEquation<TapeModel, P>;

 public:
  using Side = typename Plain::Side;
  using Theta = typename Plain::Theta;
  using Input = typename Plain::Input;
  using State = typename Plain::State;

  // `model` must outlive the equation.
  VariationalEquation(const TapeModel& model, const Theta& theta, const Input& u)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        rates_(model.programs().rate_jacobian, model.shape(), theta, u),
        output_(model.programs().output_jacobian, model.shape(), theta, u) {}

  const Dependence<TapeModel>& dependence;

  double inverse_scale(int i) const { return model_.inverse_scale(i); }

  void linearise(const State& x, const Side& side, State& dx, Jacobian<TapeModel, P>& jacobian) const {
    rates_.run(x, side);
    int at = 0;
    for (P& rate : dx) rate = rates_.output(at++);
    for (P& entry : jacobian.by_state) entry = rates_.output(at++);
    for (P& entry : jacobian.by_theta) entry = rates_.output(at++);
  }

  void output(const State& x, const Columns<TapeModel, P>& s, typename Plain::Output& y, std::vector<P>& dy_dtheta) const {
    output_.run(x);
    int at = 0;
    for (P& value : y) value = output_.output(at++);
    std::fill(dy_dtheta.begin(), dy_dtheta.end(), P(0.0));
    for (const auto [i, k] : model_.output_entries()) {
      const P slope = output_.output(at++);
      if (k >= states) {
        dy_dtheta[i * parameters + k - states] += slope;
        continue;
      }
      for (int j = 0; j < parameters; ++j)
        if (dependence.depends(k, j))
          dy_dtheta[i * parameters + j] += slope * s[dependence.column_start[j] + detail::below(dependence.rows(j), k)];
    }
  }

 private:
  const TapeModel& model_;
  mutable Machine<P> rates_, output_;
};

}  // namespace fisherpoint
