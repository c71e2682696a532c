// Arrays of experiment points as the kernels take them, row-major, and their transport into the lanes of packs.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "model.hpp"
#include "pack.hpp"

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

// Lanes = points [first, first + used) of a batch; the lanes behind them rest.
template <Model M, class P>
struct PointPack {
  static constexpr int width = lanes_of<P>::width;
  std::array<P, sizes<M>::states> x0;
  std::array<P, sizes<M>::inputs> u;
  std::array<P, sizes<M>::parameters> theta;
  P dt{0.0};
  int used;

  PointPack(const Points& points, const Parameters& parameters, std::size_t first)
      : used(static_cast<int>(std::min<std::size_t>(width, points.count - first))) {
    for (int lane = 0; lane < width; ++lane) {
      const std::size_t k = first + std::min(lane, used - 1);
      set_lane(x0, lane, points.x0 + k * sizes<M>::states);
      set_lane(u, lane, points.u + k * sizes<M>::inputs);
      set_lane(theta, lane, parameters.of(k, sizes<M>::parameters));
      lanes_of<P>::set(dt, lane, lane < used ? points.dt[k] : 0.0);
    }
  }
};

}  // namespace fisherpoint
