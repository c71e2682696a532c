// Where trajectories have come to with their columns of S, and its way into the rows of results.
#pragma once

#include <cstddef>
#include <span>

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/kernels/derivatives_at_jumps.hpp"
#include "fisherpoint/kernels/points.hpp"

namespace fisherpoint {

struct SensitiveTrajectories {
  double *x, *y;                  // (count, n_x), (count, n_y), where the trajectory ended
  double *dx_dtheta, *dy_dtheta;  // (count, n_x, p) or none, (count, n_y, p); zero where it is not ok
  Status* status;                 // (count,)
  bool states_judge = false;      // whether a point ends on a jump that its states feel is on_jump also without dx_dtheta
};

// Where x and columns have come to: what is measured there, and what parameters do to both.
template <class M, class P>
struct ColumnEnds {
  typename StateEquation<M, P>::State x;
  typename StateEquation<M, P>::Output y;
  ShelfVector<P> dx, dy;
  mask_of_lanes<P> whole;  // where all of them are finite

  // With `carried`, an output that has no derivative, or no value, counts only where it is asked for.
  ColumnEnds(const VariationalEquation<M, P>& equation, const auto& tangents, std::span<const std::size_t> rows,
             const Carried* carried)
      : x(tangents.x),
        dx(std::size_t(equation.states) * std::size_t(equation.parameters)),
        dy(std::size_t(equation.outputs) * std::size_t(equation.parameters)) {
    fit(y, equation.outputs);
    equation.output(tangents.x, tangents.s, y, dy);
    for_each_index(equation.states, [&](auto i) {
      for_each_index(equation.parameters, [&](auto j) {
        P& entry = dx[i * equation.parameters + j] = P(0.0);
        if (equation.dependence.depends(i, j))
          entry = tangents.s[equation.dependence.column_start[j] + detail::below(equation.dependence.rows(j), i)];
      });
    });
    const mask_of_lanes<P> ends = finite<P>(x) & finite<P>(dx), known = finite<P>(y) & finite<P>(dy);
    whole = ends & known;
    for (int lane = 0; carried && lane < static_cast<int>(rows.size()); ++lane)
      if (!carried->measured[rows[lane]] && !lanes_of<P>::get(known, lane) && lanes_of<P>::get(ends, lane)) {
        for (P& entry : y) lanes_of<P>::set(entry, lane, 0.0);
        for (P& entry : dy) lanes_of<P>::set(entry, lane, 0.0);
        lanes_of<P>::set(whole, lane, true);
      }
  }

  // As what point k has come to.
  void store(int lane, std::size_t k, bool has_derivative, const SensitiveTrajectories& out) const {
    if (!lanes_of<P>::get(whole, lane)) {
      out.status[k] = Status::not_finite;
      return;
    }
    get_lane(x, lane, out.x + k * x.size());
    get_lane(y, lane, out.y + k * y.size());
    if (out.dx_dtheta) get_lane(dx, lane, out.dx_dtheta + k * dx.size());
    if (has_derivative) get_lane(dy, lane, out.dy_dtheta + k * dy.size());
  }
};

}  // namespace fisherpoint
