// The same steps by columns (tangents.hpp) and by rows (adjoints.hpp).
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "fisherpoint/integration/adjoints.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/numbers/lanes.hpp"

namespace fisherpoint::testing {

struct Start {
  std::vector<double> x0, u, theta, side;
};

// Largest difference of any column of S, as a share of its size, between rows and columns over `steps` steps in `duration`; the
// lanes differ in their steps, starts and parameters.
template <class P, class Method, class M>
double difference_of_rows(const M& model, const Start& start, double duration, int steps, const Tolerance& tolerance = {}) {
  using Equation = VariationalEquation<M, P>;
  const auto shape = shape_of(model);
  typename Equation::Theta theta;
  typename Equation::Input u;
  typename Equation::State x0;
  typename Equation::Side side;
  fit(theta, shape.parameters);
  fit(u, shape.inputs);
  fit(x0, shape.states);
  fit(side, shape.sides);
  set_lanes(u, start.u.data());
  set_lanes(side, start.side.data());
  P size(0.0);
  for (int lane = 0; lane < lanes_of<P>::width; ++lane) {
    const auto scaled = [&](std::vector<double> values) {
      for (double& value : values) value *= 1.0 + 1e-3 * lane;
      return values;
    };
    set_lane(theta, lane, scaled(start.theta).data());
    set_lane(x0, lane, scaled(start.x0).data());
    lanes_of<P>::set(size, lane, duration / steps * (1.0 - 0.01 * lane));
  }
  const Equation equation(model, theta, u);
  Tangents<M, P, Method> tangents(equation, x0, tolerance);
  Adjoints<M, P, Method> adjoints(equation, x0, tolerance);
  for (int n = 0; n < steps; ++n) {
    tangents.advance(size, side);
    adjoints.advance(size, side);
  }
  typename Adjoints<M, P, Method>::Rows rows;
  for_each_variable(equation.dependence.sensitive(), [&](auto i) {
    rows.push_back(adjoints.row());
    rows.back().lambda[i] = P(1.0);
    rows.back().inverse_scale = P(equation.inverse_scale(i));
  });
  adjoints.back(rows);

  double largest = 0.0;
  for (int lane = 0; lane < lanes_of<P>::width; ++lane) {
    for (int i = 0; i < shape.states; ++i)
      CHECK(lanes_of<P>::get(adjoints.x[i], lane) == lanes_of<P>::get(tangents.x[i], lane));
    for_each_index(shape.parameters, [&](auto j) {
      double squares = 0.0, worst = 0.0;
      std::size_t row = 0;
      const auto in_column = equation.dependence.rows(j);
      for_each_variable(equation.dependence.sensitive(), [&](auto i) {
        const double by_row = lanes_of<P>::get(rows[row++].gradient[j], lane);
        double by_column = 0.0;
        if (equation.dependence.depends(i, j))
          by_column = lanes_of<P>::get(tangents.s[equation.dependence.column_start[j] + detail::below(in_column, i)], lane);
        else
          CHECK(by_row == 0.0);
        squares += std::pow(by_column * equation.inverse_scale(i), 2);
        worst = std::max(worst, std::abs(by_row - by_column) * equation.inverse_scale(i));
      });
      REQUIRE(squares > 0.0);
      largest = std::max(largest, worst / std::sqrt(squares));
    });
  }
  return largest;
}

}  // namespace fisherpoint::testing
