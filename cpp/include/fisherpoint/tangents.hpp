// A step of the variational equation (9) of known size: first x with the Jacobian of every stage, then the columns of S, one
// parameter after the other. Columns of one pattern share their code, so that it stays in the instruction cache; the stages of
// one column stay in the data cache.
#pragma once

#include <array>

#include "runge_kutta.hpp"
#include "sensitivity.hpp"
#include "unroll.hpp"

namespace fisherpoint {

template <Model M, class P, class Method>
class Tangents {
  using Equation = VariationalEquation<M, P>;
  using State = typename Equation::State;
  static constexpr int n_x = Equation::states, p = Equation::parameters, last = Method::stages - 1;
  static constexpr int stages = last + end_counts<Method>();  // that take part in S

 public:
  State x;
  typename Equation::Columns s;

  Tangents(const Equation& equation, const State& x0) : x(x0), f_(equation) {
    s.fill(P(0.0));
    squared_column_error_.fill(P(0.0));
    squared_column_size_.fill(P(0.0));
  }

  // The largest estimated error: of x in units of the states' scales, of every column in units of its own size. Against the
  // size of the outputs, columns of weak parameters would be integrated without any control. NaN where anything is.
  P relative_error() const {
    P sum = squared_error_, largest = squared_error_;
    for (int j = 0; j < p; ++j) {
      const P share = squared_column_error_[j] / (squared_column_size_[j] + 1e-200);
      largest = max(largest, share);
      sum += share;
    }
    return sqrt(select(sum < P(1e300), largest, sum));
  }

  // A lane whose step is 0 stays as it is.
  FISHERPOINT_HOT void advance(const P& step, const typename Equation::Side& side) {
    State rate[Method::stages], ahead;
    for_each_index<stages>([&](auto s) {
      for_each_index<n_x>([&](auto i) { ahead[i] = weighted_sum<s>(x[i], Method::a[s], rate, i); });
      linearise(ahead, side, step, rate[s], jacobian_[s]);
    });
    squared_error_ += finish<n_x>(x.data(), rate, [](auto i) { return scale<i>(); });
    for_each_index<p>([&](auto j) {
      if constexpr (leader(j) == j)
        for (int k = j; k < p; k = next_alike[k]) advance_column<j>(k);
    });
  }

 private:
  // All that the stage adds up, per step; once in the code for all stages, which would overflow the instruction cache.
  FISHERPOINT_HOT void linearise(const State& at, const typename Equation::Side& side, const P& step, State& rate,
                                 typename Equation::Jacobian& jacobian) const {
    f_.linearise(at, side, rate, jacobian);
    for (P& entry : rate) entry *= step;
    for (P& entry : jacobian.by_state) entry *= step;
    for (P& entry : jacobian.by_theta) entry *= step;
  }

  // The first of the parameters whose columns have the pattern of column j.
  static constexpr int leader(int j) {
    for (int k = 0; k < j; ++k)
      if (Equation::rows(k) == Equation::rows(j) && Equation::driven(k) == Equation::driven(j)) return k;
    return j;
  }

  // The next parameter whose column has the same pattern, or p.
  static constexpr auto next_alike = []<int... j>(std::integer_sequence<int, j...>) {
    const std::array<int, p> first{leader(j)...};
    std::array<int, p> next;
    for (int i = 0; i < p; ++i)
      for (next[i] = i + 1; next[i] < p && first[next[i]] != first[i];) ++next[i];
    return next;
  }(std::make_integer_sequence<int, p>{});

  // Column k, which has the pattern of column j.
  template <int j>
  void advance_column(int k) {
    constexpr Variables rows = Equation::rows(j), driven = Equation::driven(j);
    constexpr int n = std::popcount(rows);
    std::array<P, n> rate[Method::stages], ahead;
    P* const column = &s[column_start[k]];
    const int drive_start = theta_start[k];
    for_each_index<stages>([&](auto s) {
      for_each_index<n>([&](auto r) { ahead[r] = weighted_sum<s>(column[r], Method::a[s], rate, r); });
      const auto& jacobian = jacobian_[s];
      for_each_variable<rows>([&](auto i) {
        constexpr int r = Dual<P, rows>::template position<i>;
        P sum(0.0);
        if constexpr ((driven >> i) & 1) sum = jacobian.by_theta[drive_start + Dual<P, driven>::template position<i>];
        for_each_variable<(Equation::coupled(i) & rows)>([&](auto m) {
          sum += jacobian.by_state[Equation::state_place(i, m)] * ahead[Dual<P, rows>::template position<m>];
        });
        rate[s][r] = sum;
      });
    });
    const auto scale_of = [](auto r) { return scale<detail::nth_bit<rows, r>()>(); };
    squared_column_error_[k] += finish<n>(column, rate, scale_of);
    P size(0.0);
    for_each_index<n>([&](auto r) { size += square(column[r] * scale_of(r)); });
    squared_column_size_[k] = max(squared_column_size_[k], size);
  }

  // Moves n numbers to the step's end; returns the square of their estimated error in units of the scales.
  template <int n>
  static P finish(P* values, const auto* rate, auto&& scale_of) {
    P error(0.0), coarse(0.0);
    for_each_index<n>([&](auto r) {
      const P change = weighted_sum<last>(Method::a[last], rate, r);
      values[r] += change;
      error += square(scale_of(r) * weighted_sum<stages>(Method::error, rate, r));
      if constexpr (requires { Method::coarse; })
        coarse += square(scale_of(r) * (change - weighted_sum<last>(Method::coarse, rate, r)));
    });
    if constexpr (requires { Method::coarse; })
      return Method::squared_error(error, coarse);
    else
      return Method::squared_error(error);
  }

  static P square(const P& a) { return a * a; }
  template <int i>
  static constexpr double scale() {
    return 1.0 / M::states[i].scale;
  }
  static constexpr auto column_start = []<int... j>(std::integer_sequence<int, j...>) {
    return std::array<int, p>{Equation::place(0, j)...};
  }(std::make_integer_sequence<int, p>{});
  static constexpr auto theta_start = []<int... j>(std::integer_sequence<int, j...>) {
    return std::array<int, p>{Equation::theta_place(j, 0)...};
  }(std::make_integer_sequence<int, p>{});

  const Equation& f_;
  // Squared estimates, summed over the steps, in units of the states' scales: of the error of x, and of the error and the
  // largest size of every column.
  P squared_error_{0.0};
  std::array<P, p> squared_column_error_, squared_column_size_;
  typename Equation::Jacobian jacobian_[stages];
};

}  // namespace fisherpoint
