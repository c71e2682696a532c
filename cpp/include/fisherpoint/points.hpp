// Arrays of experiment points as the kernels take them, row-major, and their transport into the lanes of packs.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

#include "model.hpp"
#include "pack.hpp"
#include "workers.hpp"

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

// Lane `lane` of n packs from n numbers.
template <class P, std::size_t n>
void set_lane(std::array<P, n>& packs, int lane, const double* from) {
  for (std::size_t i = 0; i < n; ++i) lanes_of<P>::set(packs[i], lane, from[i]);
}
template <class P, std::size_t n>
void get_lane(const std::array<P, n>& packs, int lane, double* to) {
  for (std::size_t i = 0; i < n; ++i) to[i] = lanes_of<P>::get(packs[i], lane);
}

// Lanes = points[rows[0]], points[rows[1]], ...; the lanes behind the last rest.
template <Model M, class P>
struct PointPack {
  static constexpr int width = lanes_of<P>::width;
  std::array<P, sizes<M>::states> x0;
  std::array<P, sizes<M>::inputs> u;
  std::array<P, sizes<M>::parameters> theta;
  P dt{0.0};
  int used;

  PointPack(const Points& points, const Parameters& parameters, std::span<const std::size_t> rows)
      : used(static_cast<int>(rows.size())) {
    for (int lane = 0; lane < width; ++lane) {
      const std::size_t k = rows[std::min(lane, used - 1)];
      set_lane(x0, lane, points.x0 + k * sizes<M>::states);
      set_lane(u, lane, points.u + k * sizes<M>::inputs);
      set_lane(theta, lane, parameters.of(k, sizes<M>::parameters));
      lanes_of<P>::set(dt, lane, lane < used ? points.dt[k] : 0.0);
    }
  }
};

// work(rows) for all points in packs of `width`, in the given order.
inline void in_packs(const Workers& workers, std::span<const std::size_t> order, std::size_t width, auto&& work) {
  workers.for_each((order.size() + width - 1) / width,
                   [&](std::size_t item) { work(order.subspan(item * width, std::min(width, order.size() - item * width))); });
}

// The points' numbers, by increasing duration: what takes alike many steps shares a pack.
inline std::vector<std::size_t> by_duration(const Points& points) {
  std::vector<std::size_t> order(points.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return points.dt[a] < points.dt[b]; });
  return order;
}

}  // namespace fisherpoint
