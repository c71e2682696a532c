// A step of the variational equation (9) of known size: first x with the Jacobian of every stage, then the columns of S, one
// parameter after the other. Columns of one pattern share their code, so that it stays in the instruction cache; the stages of
// one column stay in the data cache.
#pragma once

#include <array>

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
class Tangents {
  using Equation = VariationalEquation<M, P>;
  using State = typename Equation::State;
  static constexpr int last = Method::stages - 1;
  static constexpr int stages = last + end_counts<Method>();  // that take part in S

 public:
  State x;
  Columns<M, P> s;

  Tangents(const Equation& equation, const State& x0) : x(x0), f_(equation) {
    fit(s, f_.dependence.in_columns);
    fit(squared_column_error_, f_.parameters);
    fit(squared_column_size_, f_.parameters);
    for (Jacobian<M, P>& jacobian : jacobian_) {
      fit(jacobian.by_state, f_.dependence.by_state);
      fit(jacobian.by_theta, f_.dependence.by_theta);
    }
    s.fill(P(0.0));
    squared_column_error_.fill(P(0.0));
    squared_column_size_.fill(P(0.0));
  }

  // The largest estimated error: of x in units of the states' scales, of every column in units of its own size. Against the
  // size of the outputs, columns of weak parameters would be integrated without any control. NaN where anything is.
  P relative_error() const {
    P sum = squared_error_, largest = squared_error_;
    for (int j = 0; j < f_.parameters; ++j) {
      const P share = squared_column_error_[j] / (squared_column_size_[j] + 1e-200);
      largest = max(largest, share);
      sum += share;
    }
    return sqrt(select(sum < P(1e300), largest, sum));
  }

  // A lane whose step is 0 stays as it is.
  FISHERPOINT_HOT void advance(const P& step, const typename Equation::Side& side) {
    State rate[Method::stages], ahead;
    fit_all(rate, ahead);
    for_each_index(counted<Equation, stages>(), [&](auto s) {
      for_each_index(f_.states, [&](auto i) { ahead[i] = weighted_sum(s, x[i], Method::a[s], rate, i); });
      linearise(ahead, side, step, rate[s], jacobian_[s]);
    });
    Estimate estimate;
    for_each_index(f_.states, [&](auto i) { estimate.add(finish(x[i], rate, i), f_.inverse_scale(i)); });
    squared_error_ += estimate.squared();
    for_each_index(f_.parameters, [&](auto j) {
      if (f_.dependence.leader(j) != j) return;
      for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) advance_column(j, k);
    });
  }

 private:
  // All that the stage adds up, per step; once in the code for all stages, which would overflow the instruction cache.
  FISHERPOINT_HOT void linearise(const State& at, const typename Equation::Side& side, const P& step, State& rate,
                                 Jacobian<M, P>& jacobian) const {
    f_.linearise(at, side, rate, jacobian);
    for (P& entry : rate) entry *= step;
    for (P& entry : jacobian.by_state) entry *= step;
    for (P& entry : jacobian.by_theta) entry *= step;
  }

  // What embedded solutions tell about the error of a step, summed over numbers in units of their scales.
  struct Estimate {
    P error{0.0}, coarse{0.0};

    void add(const std::pair<P, P>& differences, double inverse_scale) {
      error += square(inverse_scale * differences.first);
      coarse += square(inverse_scale * differences.second);
    }
    P squared() const { return Method::squared_error(error, coarse); }
  };

  // Moves a number to the step's end; returns its differences to the embedded solutions.
  static std::pair<P, P> finish(P& value, const State* rate, auto i) {
    const P change = weighted_sum(counted<Equation, last>(), Method::a[last], rate, i);
    value += change;
    const P coarse = change - weighted_sum(counted<Equation, last>(), Method::coarse, rate, i);
    return {weighted_sum(counted<Equation, stages>(), Method::error, rate, i), coarse};
  }

  static P square(const P& a) { return a * a; }

  void fit_all(State (&rate)[Method::stages], State& ahead) const {
    for (State& one : rate) fit(one, f_.states);
    fit(ahead, f_.states);
  }

  // Column k, which has the pattern of column j.
  void advance_column(auto j, int k) {
    const auto rows = f_.dependence.rows(j);
    const auto driven = f_.dependence.driven(j);
    P* const column = &s[f_.dependence.column_start[k]];
    const int drive_start = f_.dependence.theta_start[k];
    State rate[Method::stages], ahead;  // of the column's states alone
    fit_all(rate, ahead);
    for_each_index(counted<Equation, stages>(), [&](auto s) {
      for_each_variable(rows,
                        [&](auto i) { ahead[i] = weighted_sum(s, column[detail::below(rows, i)], Method::a[s], rate, i); });
      const auto& jacobian = jacobian_[s];
      for_each_variable(rows, [&](auto i) {
        P sum(0.0);
        if ((driven >> i) & 1) sum = jacobian.by_theta[drive_start + detail::below(driven, i)];
        const auto coupled = f_.dependence.coupled(i);
        for_each_variable(both(coupled, rows), [&](auto m) {
          sum += jacobian.by_state[f_.dependence.state_start[i] + detail::below(coupled, m)] * ahead[m];
        });
        rate[s][i] = sum;
      });
    });
    Estimate estimate;
    P size(0.0);
    for_each_variable(rows, [&](auto i) {
      P& entry = column[detail::below(rows, i)];
      estimate.add(finish(entry, rate, i), f_.inverse_scale(i));
      size += square(entry * f_.inverse_scale(i));
    });
    squared_column_error_[k] += estimate.squared();
    squared_column_size_[k] = max(squared_column_size_[k], size);
  }

  const Equation& f_;
  // Squared estimates, summed over the steps, in units of the states' scales: of the error of x, and of the error and the
  // largest size of every column.
  P squared_error_{0.0};
  typename ArraysOf<M, P>::Parameters squared_column_error_, squared_column_size_;
  Jacobian<M, P> jacobian_[stages];
};

}  // namespace fisherpoint
