// Plain numbers into the lanes of packs, and back.
#pragma once

#include <algorithm>
#include <type_traits>

#include "fisherpoint/numbers/arrays.hpp"
#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

// Lane `lane` of n packs from n numbers.
void set_lane(auto& packs, int lane, const double* from) {
  for (auto& pack : packs) lanes_of<std::remove_cvref_t<decltype(pack)>>::set(pack, lane, *from++);
}
void get_lane(const auto& packs, int lane, double* to) {
  for (const auto& pack : packs) *to++ = lanes_of<std::remove_cvref_t<decltype(pack)>>::get(pack, lane);
}
// One lane as plain numbers, `n` of them.
template <class N>
Numbers<double, N> of_lane(const auto& packs, N n, int lane = 0) {
  Numbers<double, N> values;
  fit(values, n);
  get_lane(packs, lane, values.data());
  return values;
}
template <class N>
Numbers<double, N> of_row(const double* row, N n) {
  Numbers<double, N> values;
  fit(values, n);
  std::copy_n(row, int{n}, values.begin());
  return values;
}
// All lanes alike.
void set_lanes(auto& packs, const double* from) {
  for (auto& pack : packs) pack = std::remove_cvref_t<decltype(pack)>(*from++);
}

// The lanes in which every number is finite.
template <class P>
mask_of_lanes<P> finite(const auto& packs) {
  P sum(0.0);  // of zeros, unless a number is infinite or NaN
  for (const P& pack : packs) sum += P(0.0) * pack;
  return sum <= P(0.0);
}

}  // namespace fisherpoint
