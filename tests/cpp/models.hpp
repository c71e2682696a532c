// Small models with known answers, and a plain double-precision route to every trajectory.
#pragma once

#include <array>
#include <cmath>
#include <string_view>
#include <tuple>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/kernels/kernel_models.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/models/hydraulic_cylinder.hpp"
#include "fisherpoint/models/model.hpp"

namespace fisherpoint::testing {

// x'' = -w^2 x: x = a cos(w t) + b sin(w t) / w.
struct Oscillator {
  static constexpr std::string_view name = "oscillator";
  static constexpr std::array states = {Quantity{"x", "1", "", 1.0}, Quantity{"v", "1", "", 1.0}};
  static constexpr std::array inputs = {Quantity{"u", "1", "", 1.0}};
  static constexpr std::array outputs = {states[0]};
  static constexpr std::array parameters = {Quantity{"w", "1", "", 1.0}};
  static constexpr std::array<Surface, 0> jumps = {}, kinks = {}, domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [w] = theta;
    const auto square = w * w;
    return [=](const auto& x, const auto&, const auto&) { return std::tuple{std::get<1>(x), -(square * std::get<0>(x))}; };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x)}; }
  auto switching(const auto&, const auto&, const auto&) const { return std::tuple{}; }
  auto limits(const auto&, const auto&, const auto&) const { return std::tuple{}; }
};

// A ball thrown up: s' = v, v' = -g. Its height h = s - `floor` is a surface of the chosen kind.
//   as a jump or a limit: the ball grazes or passes it (twice, when thrown from below);
//   as a kink: v' = -g - k max(s - floor, 0), a spring above it.
enum class Kind { jump, kink, limit };
template <Kind kind>
struct Ball {
  double floor = 0.0;
  static constexpr std::string_view name = "ball";
  static constexpr std::array states = {Quantity{"s", "m", "", 1.0}, Quantity{"v", "m/s", "", 1.0}};
  static constexpr std::array inputs = {Quantity{"u", "1", "", 1.0}};
  static constexpr std::array outputs = {states[0]};
  static constexpr std::array parameters = {Quantity{"g", "m/s2", "", 1.0}, Quantity{"k", "1/s2", "", 1.0}};
  static constexpr std::array<Surface, kind == Kind::jump> jumps = {};
  static constexpr std::array<Surface, kind == Kind::kink> kinks = {};
  static constexpr std::array<Surface, kind == Kind::limit> domain = {};
  auto dynamics(const auto& theta) const {
    const auto& [g, k] = theta;
    return [=, *this](const auto& x, const auto&, const auto& side) {
      const auto& [s, v] = x;
      if constexpr (kind == Kind::kink) {
        const auto& [above] = side;
        return std::tuple{v, -g - k * ((s - floor) * heaviside(above))};
      } else {
        return std::tuple{v, -g - k * (0.0 * v)};
      }
    };
  }
  auto output(const auto& x, const auto&, const auto&) const { return std::tuple{std::get<0>(x)}; }
  auto switching(const auto& x, const auto&, const auto&) const {
    if constexpr (kind == Kind::limit)
      return std::tuple{};
    else
      return std::tuple{std::get<0>(x) - floor};
  }
  auto limits(const auto& x, const auto&, const auto&) const {
    if constexpr (kind == Kind::limit)
      return std::tuple{std::get<0>(x) - floor};
    else
      return std::tuple{};
  }
};

// Methods that tests are tried with; one is enough under the sanitizers, and compiles in half the time.
#if defined(FISHERPOINT_SANITIZED)
#define FISHERPOINT_METHODS DormandPrince853
#else
#define FISHERPOINT_METHODS DormandPrince, DormandPrince853
#endif

inline constexpr std::array<double, 9> cylinder_theta = {400, 1500, 150, 1.2e9, 0.5e6, 1.782e-7, 2.5e-9, 5e-5, 4e-5};

// One trajectory on number type P; every lane carries the same point.
template <class P, class Method = DormandPrince853, class M, std::size_t n_x, std::size_t n_u, std::size_t p>
auto run(const M& model, const std::array<double, n_x>& x0, const std::array<double, n_u>& u, double dt,
         const std::array<double, p>& theta, Tolerance tolerance = {}) {
  using Equation = StateEquation<M, P>;
  typename Equation::Theta packed_theta;
  typename Equation::Input packed_u;
  typename Equation::State state;
  for (std::size_t i = 0; i < p; ++i) packed_theta[i] = P(theta[i]);
  for (std::size_t i = 0; i < n_u; ++i) packed_u[i] = P(u[i]);
  for (std::size_t i = 0; i < n_x; ++i) state[i] = P(x0[i]);
  const Equation equation(model, packed_theta, packed_u);
  const auto outcome = Integrator<Equation, Method>(equation, tolerance).run(state, P(dt), P(0.0));
  return std::pair{state, outcome};
}

// One point with its sensitivities.
template <class M>
struct Sensitive {
  std::array<double, sizes<M>::states> x;
  std::array<double, sizes<M>::outputs> y;
  std::array<std::array<double, sizes<M>::parameters>, sizes<M>::states> dx;
  std::array<std::array<double, sizes<M>::parameters>, sizes<M>::outputs> dy;
  Status status;
};
template <class P = double, class Method = DormandPrince853, class M, std::size_t n_x, std::size_t n_u, std::size_t p>
Sensitive<M> run_sensitive(const M& model, const std::array<double, n_x>& x0, const std::array<double, n_u>& u, double dt,
                           const std::array<double, p>& theta, Tolerance tolerance = {}) {
  Sensitive<M> r;
  sensitivity_packs<P, Method>(model, Points{1, x0.data(), u.data(), &dt}, Parameters{theta.data(), false}, tolerance,
                               Workers(1),
                               SensitiveTrajectories{r.x.data(), r.y.data(), r.dx[0].data(), r.dy[0].data(), &r.status});
  return r;
}

}  // namespace fisherpoint::testing

// Integrators that several tests have in common are compiled once, in cylinder_integrator.cpp and small_integrators.cpp: they
// are most of what a test takes to compile.
namespace fisherpoint {

extern template class Integrator<StateEquation<HydraulicCylinder, double>, DormandPrince853>;
extern template class Integrator<StateEquation<testing::Oscillator, double>, DormandPrince853>;
extern template class Integrator<StateEquation<testing::Oscillator, Pack<native_lanes>>, DormandPrince853>;
extern template class Integrator<StateEquation<testing::Ball<testing::Kind::kink>, double>, DormandPrince853>;
extern template class Integrator<StateEquation<testing::Ball<testing::Kind::kink>, Pack<native_lanes>>, DormandPrince853>;
extern template class Integrator<StateEquation<testing::Ball<testing::Kind::jump>, Pack<native_lanes>>, DormandPrince853>;

}  // namespace fisherpoint
