// Switches of inputs in instants that are parameters, as those of an input with a dead time.
//
// x goes on through a switch, and S by the parameter that moves it jumps by f_before - f_after: one that comes later leaves f
// as it was for so much longer. What is set anew in that instant takes S + f_before with it (tangents.hpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/segment_ends.hpp"

namespace fisherpoint {

// Those at the starts of the segments of runs, up to `each` of them together.
struct MovedSwitches {
  std::size_t each = 0;
  const std::int32_t* column = nullptr;  // (count, segments, each), the parameter that moves it, -1 for none
  const double* u = nullptr;             // (count, segments, each, n_u), the inputs as long as this one has not come
};

// The same for points that are next, with f before the switch.
struct MovedStarts {
  std::size_t each = 0;
  const std::int32_t* column = nullptr;  // (count, each)
  const double* rate = nullptr;          // (count, each, n_x)
  std::size_t jumps = 0;
  const unsigned char* slid = nullptr;  // (count, each, jumps), whether it slides on them before

  bool any_of(std::span<const std::size_t> rows) const {
    for (const std::size_t k : rows)
      for (std::size_t e = 0; e < each; ++e)
        if (column[k * each + e] >= 0) return true;
    return false;
  }
  // What f before the switch of point k adds to h_x S in column j, by state i, until the switch is behind: nothing to that of a
  // jump m that it slides on, but rounding.
  double of(std::size_t k, int j, int i, int m, int n_x) const {
    for (std::size_t e = k * each; e < (k + 1) * each; ++e)
      if (column[e] == j) return static_cast<std::size_t>(m) < jumps && slid[e * jumps + m] ? 0.0 : rate[e * n_x + i];
    return 0.0;
  }
};

// f at the starts of points[rows[0]], ..., into rate + k * each * n_x, on the sides on which their segments would begin, and
// whether they slide on each of the jumps into slid + k * each * jumps.
template <class P, class Method, class M>
void rates_at_starts(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                     std::span<const std::size_t> rows, SegmentEnd* const* ends, const double* came, double* rate,
                     unsigned char* slid, std::size_t each) {
  using Equation = StateEquation<M, P>;
  const auto shape = shape_of(model);
  const PointPack<M, P> pack(shape, points, parameters, rows);
  const Equation equation(model, pack.theta, pack.u, pack.used);
  Integrator<Equation, Method> integrator(equation, tolerance);
  typename Equation::Side from, met;
  fit(from, shape.sides);
  fit(met, shape.sides);
  from.fill(P(unknown_side));
  met.fill(P(0.0));
  if (goes_on_from_ends(shape)) {
    from = sides_of_ends<M, P>(model, equation, pack.theta, pack.states_of(rows, came), pack.x0, pack.u, pack.used,
                               [&](int lane) -> const SegmentEnd& { return *ends[rows[lane]]; });
    hold_conditions<P>(integrator.held(), pack.used, [&](int lane) { return ends[rows[lane]]; });
  }
  auto stopped = lanes_of<P>::none();
  typename Equation::State x = pack.x0, dx;
  const auto side = integrator.sides_from(pack.x0, pack.dt, from, met, stopped, &x);
  fit(dx, shape.states);
  if (shape.holds_end > 0)
    rates_along(equation, x, side, dx);
  else
    equation.derivative(x, side, dx);
  for (int lane = 0; lane < pack.used; ++lane) {
    get_lane(dx, lane, rate + rows[lane] * each * shape.states);
    for (int m = 0; m < shape.jumps_end; ++m)
      slid[rows[lane] * each * shape.jumps_end + m] = lanes_of<P>::get(side[m], lane) == 0.0;
  }
}

}  // namespace fisherpoint
