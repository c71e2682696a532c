// Elementary functions of numbers of any kind, lane by lane; square roots, absolute values and extremes are in pack.hpp.
#pragma once

#include <cmath>

#include "pack.hpp"

namespace fisherpoint {

template <class P>
P each_lane(const P& a, double (*function)(double)) {
  P r;
  for (int lane = 0; lane < lanes_of<P>::width; ++lane) lanes_of<P>::set(r, lane, function(lanes_of<P>::get(a, lane)));
  return r;
}

template <class P>
P power(const P& a, const P& b) {
  P r;
  for (int lane = 0; lane < lanes_of<P>::width; ++lane)
    lanes_of<P>::set(r, lane, std::pow(lanes_of<P>::get(a, lane), lanes_of<P>::get(b, lane)));
  return r;
}

template <class P>
P sign(const P& a) {
  return select(a > P(0.0), P(1.0), select(a < P(0.0), P(-1.0), a));
}

}  // namespace fisherpoint
