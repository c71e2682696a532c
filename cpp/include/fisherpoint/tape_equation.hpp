// The state equation and the variational equation (9) of a tape (tape.hpp), as the integrator takes them.
#pragma once

#include "functions.hpp"
#include "points.hpp"
#include "sensitivity.hpp"
#include "state_equation.hpp"
#include "tape.hpp"

namespace fisherpoint {

// A program with the registers that it works on. Leaves are read where the caller keeps them.
template <class P>
class Machine {
 public:
  using Array = HeapArray<P>;

  // `theta` and `u` must outlive the machine.
  Machine(const Program& program, const Shape<TapeModel>& shape, const Array& theta, const Array& u)
      : program_(program), own_(program.registers - theta.size() - u.size()), at_(program.registers) {
    const P** next = at_.begin();
    P* own = own_.begin();
    for (const double literal : program.literals) *own = P(literal), *next++ = own++;
    next = refer(next, theta);
    x_ = next = refer(next, u);
    side_ = x_ + shape.states;
    dx_ = side_ + shape.kinks_end;
    for (next = dx_ + shape.states; next != at_.end();) *next++ = own++;
    carry_out(program.setup, at_.data());
  }

  void run(const Array& x) {
    refer(x_, x);
    carry_out(program_.stage, at_.data());
  }
  void run(const Array& x, const Array& side) {
    for (const P** place = side_; place != dx_; ++place) *place = &side[place - side_];
    run(x);
  }
  void run_along(const Array& x, const Array& dx) {
    refer(dx_, dx);
    run(x);
  }

  const P& output(int i) const { return *at_[program_.outputs[i]]; }

 private:
  [[gnu::noinline]] static void carry_out(const std::vector<Instruction>& instructions, const P* const* at) {
    using O = Operation;
    for (const auto& [operation, out, first, second, third] : instructions) {
      const P &a = *at[first], &b = *at[second], &c = *at[third];
      P& result = const_cast<P&>(*at[out]);  // of what is computed, which is our own
      switch (operation) {
        case O::add:
          result = a + b;
          break;
        case O::sub:
          result = a - b;
          break;
        case O::mul:
          result = a * b;
          break;
        case O::div:
          result = a / b;
          break;
        case O::neg:
          result = -a;
          break;
        case O::mul_add:
          result = a * b + c;
          break;
        case O::mul_sub:
          result = a * b - c;
          break;
        case O::sub_mul:
          result = c - a * b;
          break;
        case O::sqrt:
          result = sqrt(a);
          break;
        case O::exp:
          result = exp(a);
          break;
        case O::log:
          result = log(a);
          break;
        case O::sin:
          result = sin(a);
          break;
        case O::cos:
          result = cos(a);
          break;
        case O::tan:
          result = tan(a);
          break;
        case O::asin:
          result = asin(a);
          break;
        case O::acos:
          result = acos(a);
          break;
        case O::atan:
          result = atan(a);
          break;
        case O::sinh:
          result = sinh(a);
          break;
        case O::cosh:
          result = cosh(a);
          break;
        case O::tanh:
          result = tanh(a);
          break;
        case O::pow:
          result = power(a, b);
          break;
        case O::abs:
          result = abs(a);
          break;
        case O::sign:
          result = sign(a);
          break;
        case O::min:
          result = min(a, b);
          break;
        case O::max:
          result = max(a, b);
          break;
        case O::select:
          result = select(a > P(0.0), b, c);
          break;
        case O::count:
          break;
      }
    }
  }

  static const P** refer(const P** place, const Array& leaves) {
    for (const P& leaf : leaves) *place++ = &leaf;
    return place;
  }

  const Program& program_;
  Array own_;                    // literals and what is computed
  HeapArray<const P*> at_;       // where every register is
  const P **x_, **side_, **dx_;  // where these leaves are told
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

  // `model` must outlive the equation, whose machines refer to what it holds.
  StateEquation(const StateEquation&) = delete;
  StateEquation(const TapeModel& model, const Theta& theta, const Input& u)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        theta_(theta),
        u_(u),
        rates_(model.programs().rates, model.shape(), theta_, u_),
        output_(model.programs().output, model.shape(), theta_, u_),
        surfaces_(model.programs().surfaces, model.shape(), theta_, u_),
        surface_rates_(model.programs().surface_rates, model.shape(), theta_, u_) {}

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
  Theta theta_;
  Input u_;
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

  // `model` must outlive the equation, whose machines refer to what it holds.
  VariationalEquation(const VariationalEquation&) = delete;
  VariationalEquation(const TapeModel& model, const Theta& theta, const Input& u)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        theta_(theta),
        u_(u),
        rates_(model.programs().rate_jacobian, model.shape(), theta_, u_),
        output_(model.programs().output_jacobian, model.shape(), theta_, u_) {}

  const Dependence<TapeModel>& dependence;

  double inverse_scale(int i) const { return model_.inverse_scale(i); }

  void linearise(const State& x, const Side& side, State& dx, Jacobian<TapeModel, P>& jacobian) const {
    rates_.run(x, side);
    int at = 0;
    for (P& rate : dx) rate = rates_.output(at++);
    for (P& entry : jacobian.by_state) entry = rates_.output(at++);
    for (P& entry : jacobian.by_theta) entry = rates_.output(at++);
  }

  void output(const State& x, const Columns<TapeModel, P>& s, typename Plain::Output& y, ShelfVector<P>& dy_dtheta) const {
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
  Theta theta_;
  Input u_;
  mutable Machine<P> rates_, output_;
};

}  // namespace fisherpoint
