// States and outputs of a batch of experiment points, (14) and (15): lanes = points.
#pragma once

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/workers.hpp"

namespace fisherpoint {

struct Trajectories {
  double *x, *y;   // (count, n_x), (count, n_y), where the trajectory ended
  Status* status;  // (count,)
  double* lasted;  // (count,), until when they could be followed
};

template <class P, class Method, class M>
void simulate_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                    const Workers& workers, const Trajectories& out) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  in_packs<M, P>(workers, by_duration(points), [&](std::span<const std::size_t> rows) {
    const PointPack<M, P> pack(shape, points, parameters, rows);
    const Equation equation(model, pack.theta, pack.u, pack.used);
    auto x = pack.x0;
    const auto outcome = Integrator<Equation, Method>(equation, tolerance).run(x, pack.dt, P(0.0));
    store_ends<P>(x, equation.output(x), outcome.status, rows, out, outside_of_output<P>(equation, x));
    for (int lane = 0; lane < pack.used; ++lane) out.lasted[rows[lane]] = lanes_of<P>::get(outcome.lasted, lane);
  });
}

// Compiled once per model and instruction set (cpp/src/simulate.cpp).
template <class M>
void simulate(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
              const Workers& workers, const Trajectories& out);

}  // namespace fisherpoint
