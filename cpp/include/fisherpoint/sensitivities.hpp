// States, outputs and their sensitivities (8) for a batch of experiment points: lanes = points.
#pragma once

#include "integrate.hpp"
#include "points.hpp"
#include "sensitivity.hpp"
#include "workers.hpp"

namespace fisherpoint {

struct SensitiveTrajectories {
  double *x, *y, *dx_dtheta, *dy_dtheta;  // (count, n_x), (count, n_y), (count, n_x, p), (count, n_y, p)
  Status* status;                         // (count,)
};

// dy/dtheta = g_x S + g_theta.
template <Model M, class P>
auto output_sensitivity(const M& model, const typename VariationalEquation<M, P>::State& state,
                        const typename VariationalEquation<M, P>::Input& u,
                        const typename VariationalEquation<M, P>::Theta& theta) {
  using Equation = VariationalEquation<M, P>;
  constexpr int n_x = sizes<M>::states, n_y = sizes<M>::outputs, p = sizes<M>::parameters;
  const auto g = model.output(as_variables<0, n_x, P>(state), u, as_variables<n_x, p, P>(theta));
  std::array<P, n_y * p> s;
  for_each_index<n_y>([&](auto i) {
    for_each_index<p>([&](auto j) {
      const auto& g_i = std::get<i>(g);
      P sum = slope_of<n_x + j, P>(g_i);
      for_each_index<n_x>([&](auto k) {
        if constexpr ((variables_of<std::remove_cvref_t<decltype(g_i)>> >> k) & 1)
          sum += slope_of<k, P>(g_i) * Equation::template entry<k, j>(state);
      });
      s[i * p + j] = sum;
    });
  });
  return s;
}

template <class P, Model M>
void sensitivity_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                       const Workers& workers, const SensitiveTrajectories& out) {
  using Equation = VariationalEquation<M, P>;
  constexpr std::size_t width = lanes_of<P>::width;
  constexpr int n_x = sizes<M>::states, n_y = sizes<M>::outputs, p = sizes<M>::parameters;
  workers.for_each((points.count + width - 1) / width, [&](std::size_t item) {
    const std::size_t first = item * width;
    const PointPack<M, P> pack(points, parameters, first);
    const Equation equation(model, pack.theta, pack.u);
    typename Equation::State state;
    state.fill(P(0.0));
    std::copy(pack.x0.begin(), pack.x0.end(), state.begin());
    const auto outcome = Integrator(equation, tolerance).run(state, pack.dt, P(0.0));

    std::array<P, n_x> x;
    std::copy_n(state.begin(), n_x, x.begin());
    std::array<P, n_x * p> dx;
    for_each_index<n_x>(
        [&](auto i) { for_each_index<p>([&](auto j) { dx[i * p + j] = Equation::template entry<i, j>(state); }); });
    const auto y = to_array<P>(model.output(x, pack.u, pack.theta));
    const auto dy = output_sensitivity<M, P>(model, state, pack.u, pack.theta);
    for (int lane = 0; lane < pack.used; ++lane) {
      const std::size_t k = first + lane;
      get_lane(x, lane, out.x + k * n_x);
      get_lane(y, lane, out.y + k * n_y);
      get_lane(dx, lane, out.dx_dtheta + k * n_x * p);
      get_lane(dy, lane, out.dy_dtheta + k * n_y * p);
      out.status[k] = outcome.status[lane];
    }
  });
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <Model M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out);

}  // namespace fisherpoint
