// The variational equation (9): x' = f together with S' = f_x S + f_theta for S = dx/dtheta, S(0) = 0.
//
// One evaluation of f on duals gives f, f_x and f_theta without their zeros, so the product's pattern is known at compile
// time. Entries of S that stay zero for every trajectory (dx_v/dtheta of the cylinder) are found from the masks and not
// integrated.
#pragma once

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/dual.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

// The entries of f_x and f_theta that S' needs: f_x row by row, f_theta column by column and behind it a zero, which columns of
// one pattern read where they have no entry.
template <class M, class P>
struct Jacobian {
  Jacobian() {}  // not set to anything: it is always fitted first, and written

  void fit_to(const Dependence<M>& dependence) {
    fit(by_state, dependence.by_state);
    fit(by_theta, dependence.by_theta);
    by_theta[dependence.by_theta - 1] = P(0.0);
  }
  // Those of f_x first.
  P& entry(int e) {
    const int states = static_cast<int>(by_state.size());
    return e < states ? by_state[e] : by_theta[e - states];
  }

  Numbers<P, std::remove_const_t<decltype(Dependence<M>::by_state)>> by_state;
  Numbers<P, std::remove_const_t<decltype(Dependence<M>::by_theta)>> by_theta;
};

// S, column by column, without its zeros.
template <class M, class P>
using Columns = Numbers<P, std::remove_const_t<decltype(Dependence<M>::in_columns)>>;

// h of a jump, or of a kink where f_x has no bounds, with its gradient.
template <class M, class P>
struct JumpGradient {
  P value{0.0};
  typename ArraysOf<M, P>::States by_state;
  typename ArraysOf<M, P>::Parameters by_theta;

  explicit JumpGradient(const auto& shape) {
    fit(by_state, shape.states);
    fit(by_theta, shape.parameters);
    by_state.fill(P(0.0));
    by_theta.fill(P(0.0));
  }
};

template <class M, class P>
class VariationalEquation : public Shape<M> {
  using Plain = StateEquation<M, P>;
  static constexpr int n_x = sizes<M>::states, p = sizes<M>::parameters;

 public:
  using Side = typename Plain::Side;
  using Theta = typename Plain::Theta;
  using Input = typename Plain::Input;
  using State = typename Plain::State;

 private:
  static auto dynamics_of(const M& model, const Theta& theta) { return model.dynamics(as_variables<n_x, p, P>(theta)); }
  using Dynamics = decltype(dynamics_of(std::declval<const M&>(), std::declval<const Theta&>()));

 public:
  static constexpr Dependence<M> dependence{};

  VariationalEquation(const M& model, const Theta& theta, const Input& u, int = 0)
      : model_(model), theta_(theta), u_(u), dynamics_(dynamics_of(model, theta)) {}

  static constexpr int parts_in_use() { return PartsOf<P>::count; }
  static constexpr double inverse_scale(int i) { return 1.0 / M::states[i].scale; }
  const Theta& theta() const { return theta_; }

  // f and its Jacobian in x.
  void linearise(const State& x, const Side& side, State& dx, Jacobian<M, P>& jacobian) const {
    linearise(x, side, dx, [&](int e, const P& slope) { jacobian.entry(e) = slope; });
  }
  // put(e, slope) for every entry, those of f_x first.
  void linearise(const State& x, const Side& side, State& dx, auto&& put) const {
    const auto f = dynamics_(as_variables<0, n_x, P>(x), u_, side);
    for_each_index<n_x>([&](auto i) {
      const auto& f_i = std::get<i>(f);
      constexpr auto coupled = dependence.coupled(i);
      dx[i] = value_of(f_i);
      for_each_variable(coupled,
                        [&](auto k) { put(dependence.state_start[i] + detail::below(coupled, k), slope_of<k, P>(f_i)); });
      for_each_variable(dependence.parameters_of(i), [&](auto j) {
        put(dependence.by_state + dependence.theta_start[j] + detail::below(dependence.driven(j), i),
            slope_of<n_x + j, P>(f_i));
      });
    });
  }

  // y = g, and dy/dtheta = g_x S + g_theta, (n_y, p) row by row.
  void output(const State& x, const Columns<M, P>& s, typename Plain::Output& y, ShelfVector<P>& dy_dtheta) const {
    const auto g = model_.output(as_variables<0, n_x, P>(x), u_, as_variables<n_x, p, P>(theta_));
    for_each_index(Shape<M>::outputs, [&](auto i) {
      const auto& g_i = std::get<i>(g);
      y[i] = value_of(g_i);
      for_each_index<p>([&](auto j) {
        P sum = slope_of<n_x + j, P>(g_i);
        for_each_index<n_x>([&](auto k) {
          if constexpr (dependence.depends(k, j) && ((variables_of<std::remove_cvref_t<decltype(g_i)>> >> k) & 1))
            sum += slope_of<k, P>(g_i) * s[dependence.column_start[j] + detail::below(dependence.rows(j), k)];
        });
        dy_dtheta[i * p + j] = sum;
      });
    });
  }

  // y = g; by_state(i, k, slope) and by_theta(i, j, slope) are told the entries of g_x and of g_theta.
  void output_slopes(const State& x, typename Plain::Output& y, auto&& by_state, auto&& by_theta) const {
    const auto g = model_.output(as_variables<0, n_x, P>(x), u_, as_variables<n_x, p, P>(theta_));
    for_each_index(Shape<M>::outputs, [&](auto i) {
      const auto& g_i = std::get<i>(g);
      constexpr Variables read = variables_of<std::remove_cvref_t<decltype(g_i)>>;
      y[i] = value_of(g_i);
      for_each_variable<read>([&](auto k) {
        if constexpr (k < n_x)
          by_state(i, k, g_i.template slope<k>());
        else
          by_theta(i, Count<k - n_x>{}, g_i.template slope<k>());
      });
    });
  }

  // Of jump, or kink, `which` in every lane.
  JumpGradient<M, P> jump(int which, const State& x) const {
    JumpGradient<M, P> h(*this);
    const auto all = model_.switching(as_variables<0, n_x, P>(x), u_, as_variables<n_x, p, P>(theta_));
    for_each_index(Shape<M>::kinks_end, [&](auto m) {
      if (m != which) return;
      const auto& h_m = std::get<m>(all);
      h.value = value_of(h_m);
      for_each_index<n_x>([&](auto k) { h.by_state[k] = slope_of<k, P>(h_m); });
      for_each_index<p>([&](auto j) { h.by_theta[j] = slope_of<n_x + j, P>(h_m); });
    });
    return h;
  }

 private:
  M model_;
  Theta theta_;
  Input u_;
  Dynamics dynamics_;
};

}  // namespace fisherpoint
