// States and outputs of a batch of experiment points, (14) and (15): lanes = points.
#pragma once

#include "integrate.hpp"
#include "points.hpp"
#include "state_equation.hpp"
#include "workers.hpp"

namespace fisherpoint {

struct Trajectories {
  double *x, *y;   // (count, n_x), (count, n_y), where the trajectory ended
  Status* status;  // (count,)
};

template <class P, Model M>
void simulate_packs(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                    const Workers& workers, const Trajectories& out) {
  constexpr std::size_t width = lanes_of<P>::width;
  workers.for_each((points.count + width - 1) / width, [&](std::size_t item) {
    const std::size_t first = item * width;
    const PointPack<M, P> pack(points, parameters, first);
    const StateEquation<M, P> equation(model, pack.theta, pack.u);
    auto x = pack.x0;
    const auto outcome = Integrator(equation, tolerance).run(x, pack.dt, P(0.0));
    const auto y = to_array<P>(model.output(x, pack.u, pack.theta));
    for (int lane = 0; lane < pack.used; ++lane) {
      const std::size_t k = first + lane;
      get_lane(x, lane, out.x + k * sizes<M>::states);
      get_lane(y, lane, out.y + k * sizes<M>::outputs);
      out.status[k] = outcome.status[lane];
    }
  });
}

// Compiled once per model and instruction set (cpp/src/simulate.cpp).
template <Model M>
void simulate(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
              const Workers& workers, const Trajectories& out);

}  // namespace fisherpoint
