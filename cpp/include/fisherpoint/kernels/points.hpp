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

// How many of so many points, those of the last packs, are in packs of one vector each. Full packs take the least time for a
// point; but of models that are lists of operations a pack takes the less time, the fewer of its vectors are in use. So vectors
// pay where no more than half of the lanes of a round of all threads would be filled, or else of the last pack's.
inline std::size_t in_vectors(std::size_t points, std::size_t width, std::size_t threads) {
  const std::size_t of_round = points % (threads * width), of_pack = points % width;
  if (2 * of_round <= threads * width) return of_round;
  return 2 * of_pack <= width ? of_pack : 0;
}

// The rows of packs P, in the given order; the last packs first, as they take longest, so that no thread is left alone with one
// of them at the end.
template <class M, class P>
class PacksOf {
  static constexpr std::size_t width = lanes_of<P>::width;

 public:
  static constexpr std::size_t vector = Shape<M>::unrolled ? width : lanes_of<PartOf<P>>::width;

  PacksOf(std::span<const std::size_t> order, int threads) : order_(order) {
    const std::size_t last = vector < width ? in_vectors(order.size(), width, std::max(threads, 1)) : 0;
    whole_ = order.size() - last;
    full_ = (whole_ + width - 1) / width;
    count_ = full_ + (last + vector - 1) / vector;
  }

  std::size_t size() const { return count_; }
  std::span<const std::size_t> operator[](std::size_t item) const {
    const std::size_t pack = count_ - 1 - item, first = pack < full_ ? pack * width : whole_ + (pack - full_) * vector;
    const std::size_t end = pack < full_ ? std::min(first + width, whole_) : std::min(first + vector, order_.size());
    return order_.subspan(first, end - first);
  }

 private:
  std::span<const std::size_t> order_;
  std::size_t whole_, full_, count_;  // points and packs before those of one vector, and all packs
};

template <class M, class P>
void in_packs(const Workers& workers, std::span<const std::size_t> order, auto&& work) {
  const PacksOf<M, P> packs(order, workers.threads());
  workers.for_each(packs.size(), [&](std::size_t item) { work(packs[item]); });
}

// The points' numbers, by increasing duration: what takes alike many steps shares a pack.
inline std::vector<std::size_t> by_duration(const Points& points) {
  std::vector<std::size_t> order(points.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return points.dt[a] < points.dt[b]; });
  return order;
}

}  // namespace fisherpoint
