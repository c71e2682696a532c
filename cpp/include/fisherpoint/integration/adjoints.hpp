// Rows of dy/dtheta by the discrete adjoint of the Runge-Kutta steps: x goes forward with the Jacobian of every stage kept;
// then each row goes back through all steps, from lambda = dy/dx at the end. With Y_i the state at stage i,
//     mu_i = h (b_i lambda + sum_{j>i} a_ji nu_j),  nu_i = f_x(Y_i)^T mu_i,
//     gradient += sum f_theta(Y_i)^T mu_i,          lambda += sum nu_i.
// Rows equal those of the columns (tangents.hpp) over the same steps, to rounding. They cost the more the more rows there are,
// columns the more parameters. Entries of the Jacobians that are constant along a trajectory are kept once: a trajectory must
// stay on its sides of the jumps.
//
// The error is estimated by one more row for all. The embedded error of a step, e = h sum e_i f(Y_i), changes y by lambda^T e;
// how that changes with theta is a gradient too: eta goes back beside the rows, with b_i eta + e_i lambda in place of b_i
// lambda, for the sum of all rows' lambda. That is of the embedded error's low order; what a method's squared_error makes of it
// is taken from x in the same step.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/row_lists.hpp"
#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/integration/tolerance.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
class Adjoints {
  using Equation = VariationalEquation<M, P>;

 public:
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Gradient = typename ArraysOf<M, P>::Parameters;

  // lambda: the derivative of what the row is of by the state, as far as that depends on theta; by the state at the
  // trajectory's end, and once the row is back, at its start.
  struct Row {
    State lambda;
    Gradient gradient;
    P inverse_scale{1.0};  // of what the row is of, in which its error counts
  };
  using Rows = ShelfVector<Row>;

  State x;

  Adjoints(const Equation& equation, const State& x0, const Tolerance& tolerance)
      : x(x0),
        f_(equation),
        method_(method_of<Method>(tolerance)),
        least_(0.01 * tolerance.relative * tolerance.relative),
        block_(std::max<std::size_t>(1, most_kept / (sizeof(P) * std::max(1, in_step())))),
        kept_(static_cast<int>(block_) * in_step()) {
    fit(constants_, f_.dependence.constant);
    fit(squared_error_of_, f_.parameters);
    fit(squared_size_of_, f_.parameters);
    for (int j = 0; j < f_.parameters; ++j) squared_size_of_[j] = squared_rounding(f_.theta()[j], tolerance.relative);
  }

  // A lane whose step is 0 stays as it is; those of `beside` begin or end on a kink.
  void advance(const P& size, const Side& side, const mask_of_lanes<P>& beside = lanes_of<P>::none()) {
    const std::size_t at = steps_.size() % block_;
    if (at == 0) starts_.push_back(x);
    steps_.push_back({size, P(1.0), side});
    const Embedded embedded = take(steps_.back(), entries_of(at), x);
    squared_error_ += judged(method_, embedded.fine, embedded.coarse, beside);
    const P fine = embedded.fine + least_;
    steps_.back().share = sqrt(judged(method_, fine, embedded.coarse, beside) / fine);
    note_drive(size, entries_of(at));
  }

  Row row() const {
    Row row;
    fit(row.lambda, f_.states);
    fit(row.gradient, f_.parameters);
    row.lambda.fill(P(0.0));
    row.gradient.fill(P(0.0));
    return row;
  }

  // Carries all rows back to the start.
  void back(Rows& rows) {
    Row error = row();
    State sum = error.lambda;           // of all rows
    std::size_t kept = starts_.size();  // the blocks up to that whose Jacobians are kept
    for (std::size_t n = steps_.size(); n-- > 0;) {
      if (n / block_ + 1 != kept) restore((kept = n / block_ + 1) - 1);
      // All rows, and the error's, are at the end of step n: what corrects them between two steps would do so here.
      for_each_variable(f_.dependence.sensitive(), [&](auto i) {
        sum[i] = P(0.0);
        for (const Row& row : rows) sum[i] += row.lambda[i] * row.inverse_scale;
        sum[i] *= steps_[n].share;
      });
      const Step& step = steps_[n];
      const P* const here = entries_of(n % block_);
      carry_back<true>(step.size, here, sum, error.lambda, error.gradient);
      for (Row& row : rows) carry_back<false>(step.size, here, sum, row.lambda, row.gradient);
      for (int j = 0; j < f_.parameters; ++j) {
        P size(0.0);
        for (const Row& row : rows) size += square(row.gradient[j] * row.inverse_scale);
        squared_size_of_[j] = max(squared_size_of_[j], size);
      }
    }
    for (int j = 0; j < f_.parameters; ++j) squared_error_of_[j] = square(error.gradient[j]);
  }

  // The largest estimated error once the rows are back: of x in units of the states' scales; of the rows by each parameter in
  // units of their largest size on the way. NaN where anything is.
  P relative_error() const { return largest_relative_error(squared_error_, squared_error_of_, squared_size_of_); }

 private:
  struct Step {
    P size;
    P share;  // of the embedded error that squared_error takes for the error
    Side side;
  };
  // Squared differences to the embedded solutions, in units of the states' scales.
  struct Embedded {
    P fine{0.0}, coarse{0.0};
  };

  static P square(const P& a) { return a * a; }
  template <bool first>
  static auto of_either(auto one, auto other) {
    if constexpr (first)
      return one;
    else
      return other;
  }

  // A column of S is at least as large as what its parameter alone drives within a step.
  void note_drive(const P& step, const P* stage) {
    for_each_index(f_.parameters, [&](auto j) {
      P drive(0.0);
      const auto driven = f_.dependence.driven(j);
      for_each_variable(driven, [&](auto i) {
        const P& slope = by_theta(stage, f_.dependence.theta_start[j] + detail::below(driven, i));
        drive += square(f_.inverse_scale(i) * slope * step);
      });
      squared_size_of_[j] = max(squared_size_of_[j], drive);
    });
  }

  // Of a block of steps the Jacobians are kept; of those before only the state at their start.
  static constexpr std::size_t most_kept = 1 << 18;

  void restore(std::size_t block) {
    State at = starts_[block];
    for (std::size_t n = 0; n < block_; ++n) take(steps_[block * block_ + n], entries_of(n), at);
  }

  // What is kept of the step at this place of a block, one stage after the other: the entries that change.
  P* entries_of(std::size_t at) { return kept_.data() + static_cast<int>(at) * in_step(); }
  int in_step() const { return method_.in_error * f_.dependence.changing; }
  const P& entry(const P* stage, int e) const {
    const int at = f_.dependence.kept_at(e);
    return at < 0 ? constants_[~at] : stage[at];
  }
  const P& by_theta(const P* stage, int e) const { return entry(stage, f_.dependence.by_state + e); }

  FISHERPOINT_HOT Embedded take(const Step& step, P* entries, State& x) {
    State rate[Method::most_stages], ahead;
    for (int s = 0; s < method_.in_error; ++s) fit(rate[s], f_.states);
    fit(ahead, f_.states);
    for_each_index(method_.in_error, [&](auto s) {
      for_each_index(f_.states, [&](auto i) { ahead[i] = weighted_sum(s, x[i], method_.a[s], rate, i); });
      linearise(ahead, step, rate[s], entries + s * f_.dependence.changing);
    });
    Embedded embedded;
    for_each_index(f_.states, [&](auto i) {
      const P change = method_.end_of(rate, i);
      x[i] += change;
      embedded.fine += square(f_.inverse_scale(i) * method_.error_of(rate, i));
      embedded.coarse += square(f_.inverse_scale(i) * (change - method_.coarse_of(rate, i)));
    });
    return embedded;
  }

  FISHERPOINT_HOT void linearise(const State& at, const Step& step, State& rate, P* stage) {
    f_.linearise(at, step.side, rate, [&](int e, const P& slope) {
      const int place = f_.dependence.kept_at(e);
      (place < 0 ? constants_[~place] : stage[place]) = slope;
    });
    for (P& entry : rate) entry *= step.size;
  }

  template <bool of_error>
  void carry_back(const P& step, const P* entries, const State& sum, State& lambda, Gradient& gradient) {
    if constexpr (Shape<M>::unrolled) {
      carry_back_unrolled<of_error>(step, entries, sum, lambda, gradient);
    } else {
      if (!lists_) lists_.emplace(f_, method_);
      const int stages = of_error ? method_.in_error : method_.stages - 1;
      on_all_or_first_part(f_, [&]<class Q>(As<Q>) {
        lists_->template carry_back<Q>(stages, step, entries, f_.dependence.changing, constants_.data(),
                                       of_error ? sum.data() : nullptr, lambda.data(), gradient.data());
      });
    }
  }
  template <bool of_error>
  FISHERPOINT_HOT void carry_back_unrolled(const P& step, const P* entries, const State& sum, State& lambda,
                                           Gradient& gradient) const {
    const auto stages = method_.in_error;
    const auto first = of_either<of_error>(stages, before(method_.stages));
    const auto behind = of_either<of_error>(after(after(stages)), after(stages));
    State nu[Method::most_in_error + 2], mu;  // behind the stages: lambda, and the sum of all rows' lambda
    for (int r = 0; r < stages + 2; ++r) fit(nu[r], f_.states);
    fit(mu, f_.states);
    const auto sensitive = f_.dependence.sensitive();
    for_each_variable(sensitive, [&](auto i) {
      if (first < stages) nu[first][i] = P(0.0);
      nu[stages][i] = lambda[i];
      if constexpr (of_error) nu[stages + 1][i] = sum[i];
    });
    for_each_index_down(first, [&](auto s) {
      const P* const stage = entries + s * f_.dependence.changing;
      for_each_variable(sensitive, [&](auto i) {
        mu[i] = step * weighted_sum(after(s), behind, P(0.0), method_.behind[s], nu, i);
        nu[s][i] = P(0.0);
      });
      for_each_variable(sensitive, [&](auto i) {
        const auto coupled = f_.dependence.coupled(i);
        for_each_variable(coupled, [&](auto k) {
          nu[s][k] += entry(stage, f_.dependence.state_start[i] + detail::below(coupled, k)) * mu[i];
        });
      });
      for_each_index(f_.parameters, [&](auto j) {
        const auto driven = f_.dependence.driven(j);
        for_each_variable(driven, [&](auto i) {
          gradient[j] += by_theta(stage, f_.dependence.theta_start[j] + detail::below(driven, i)) * mu[i];
        });
      });
      for_each_variable(sensitive, [&](auto i) { lambda[i] += nu[s][i]; });
    });
  }

  const Equation& f_;
  const Method& method_;
  double least_;  // what is added to squared embedded errors of x: if they are far below the tolerance they are rounding
  P squared_error_{0.0};                         // estimated, of x, summed over the steps, in units of the states' scales
  Gradient squared_error_of_, squared_size_of_;  // of the rows' sum by each parameter, in units of the rows' scales
  ShelfVector<Step> steps_;
  ShelfVector<State> starts_;                                                     // of the blocks
  Numbers<P, std::remove_const_t<decltype(Dependence<M>::constant)>> constants_;  // of the Jacobian
  std::size_t block_;                                                             // steps whose Jacobians are kept at a time
  HeapArray<P> kept_;
  std::optional<RowLists<P>> lists_;  // of models that are lists of operations
};

}  // namespace fisherpoint
