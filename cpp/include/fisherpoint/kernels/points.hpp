// Arrays of experiment points as the kernels take them, row-major, and their way into packs and back.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include "fisherpoint/integration/status.hpp"
#include "fisherpoint/kernels/workers.hpp"
#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/parts.hpp"

namespace fisherpoint {

struct Points {
  std::size_t count;
  const double *x0, *u, *dt;  // (count, n_x), (count, n_u), (count,)
};

struct Parameters {
  const double* theta;  // (p,) for all points, or (count, p)
  bool per_point;

  const double* of(std::size_t point, int p) const { return per_point ? theta + point * p : theta; }
};

// Lanes = points[rows[0]], points[rows[1]], ...; the lanes behind the last rest.
template <class M, class P>
struct PointPack {
  static constexpr int width = lanes_of<P>::width;
  typename ArraysOf<M, P>::States x0;
  typename ArraysOf<M, P>::Inputs u;
  typename ArraysOf<M, P>::Parameters theta;
  P dt{0.0};
  int used;

  PointPack(const Shape<M>& shape, const Points& points, const Parameters& parameters, std::span<const std::size_t> rows)
      : used(static_cast<int>(rows.size())) {
    fit(x0, shape.states);
    fit(u, shape.inputs);
    fit(theta, shape.parameters);
    for (int lane = 0; lane < width; ++lane) {
      const std::size_t k = rows[std::min(lane, used - 1)];
      set_lane(x0, lane, points.x0 + k * shape.states);
      set_lane(u, lane, points.u + k * shape.inputs);
      set_lane(theta, lane, parameters.of(k, shape.parameters));
      lanes_of<P>::set(dt, lane, lane < used ? points.dt[k] : 0.0);
    }
  }

  // Of other states (count, n_x).
  auto states_of(std::span<const std::size_t> rows, const double* of) const {
    auto x = x0;
    for (int lane = 0; lane < width; ++lane) set_lane(x, lane, of + rows[std::min(lane, used - 1)] * x0.size());
    return x;
  }
};

// Where what must be positive for the output to have a value is not.
template <class P, class Equation>
mask_of_lanes<P> outside_of_output(const Equation& equation, const auto& x) {
  auto outside = lanes_of<P>::none();
  if (equation.measured == 0) return outside;
  const auto value = equation.surface_values(x);
  for_each_index(equation.measured, [&](auto n) { outside = outside | !(value[equation.surfaces + n] > P(0.0)); });
  return outside;
}

// Where trajectories ended, how, and what was measured there, into the rows of `out`. With an end or outputs that are not
// finite a trajectory is not ok; numbers that are not finite become zero.
//
// `outside`: lanes in which g has no value (outside_of_output). With `measured`, (count,), that counts only where it is asked
// for.
template <class P>
void store_ends(const auto& x, const auto& y, const auto& status, std::span<const std::size_t> rows, const auto& out,
                const mask_of_lanes<P>& outside = lanes_of<P>::none(), const unsigned char* measured = nullptr) {
  const mask_of_lanes<P> has_end = finite<P>(x), whole = has_end & finite<P>(y) & !outside;
  for (int lane = 0; lane < static_cast<int>(rows.size()); ++lane) {
    double* const end = out.x + rows[lane] * x.size();
    double* const outputs = out.y + rows[lane] * y.size();
    get_lane(x, lane, end);
    get_lane(y, lane, outputs);
    out.status[rows[lane]] = status[lane];
    if (lanes_of<P>::get(whole, lane)) continue;
    const auto overflowed = [](double number) { return !std::isfinite(number); };
    std::replace_if(end, end + x.size(), overflowed, 0.0);
    std::replace_if(outputs, outputs + y.size(), overflowed, 0.0);
    if (status[lane] != Status::ok || (measured && !measured[rows[lane]] && lanes_of<P>::get(has_end, lane))) continue;
    out.status[rows[lane]] = lanes_of<P>::get(outside, lane) ? Status::left_domain : Status::not_finite;
  }
}

// How many lanes of packs P are filled, of so many rows: all. But of models that are lists of operations a pack takes the less
// time, the fewer of its vectors are in use; so of few rows each thread takes those that fill one vector.
template <class M, class P>
std::size_t filled_lanes(std::size_t rows, const Workers& workers) {
  constexpr std::size_t all = lanes_of<P>::width, one = lanes_of<PartOf<P>>::width;
  return !Shape<M>::unrolled && rows <= static_cast<std::size_t>(workers.threads()) * one ? one : all;
}

// work(rows) for all points in packs of `width`, in the given order; the last packs first, as they take longest, so that no
// thread is left alone with one of them at the end.
inline void in_packs(const Workers& workers, std::span<const std::size_t> order, std::size_t width, auto&& work) {
  const std::size_t packs = (order.size() + width - 1) / width;
  workers.for_each(packs, [&](std::size_t item) {
    const std::size_t first = (packs - 1 - item) * width;
    work(order.subspan(first, std::min(width, order.size() - first)));
  });
}

// The points' numbers, by increasing duration: what takes alike many steps shares a pack.
inline std::vector<std::size_t> by_duration(const Points& points) {
  std::vector<std::size_t> order(points.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return points.dt[a] < points.dt[b]; });
  return order;
}

}  // namespace fisherpoint
