// Where S starts: members of Tangents (tangents.hpp, at whose end it is included).
#pragma once

#include <algorithm>

namespace fisherpoint {

template <class M, class P, class Method>
void Tangents<M, P, Method>::start(int lane, const double* from) {
  for (int j = 0; j < f_.parameters; ++j) {
    double size = 0.0;
    for_each_row(j, [&](int i, int at) {
      const double entry = from[i * f_.parameters + j], scaled = entry * f_.inverse_scale(i);
      lanes_of<P>::set(s[f_.dependence.column_start[j] + at], lane, entry);
      size += scaled * scaled;
    });
    P& largest = squared_column_size_[j];
    lanes_of<P>::set(largest, lane, std::max(lanes_of<P>::get(largest, lane), size));
  }
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::add_rate(int lane, int j, const double* before) {
  for_each_row(j, [&](int i, int at) {
    P& entry = s[f_.dependence.column_start[j] + at];
    lanes_of<P>::set(entry, lane, lanes_of<P>::get(entry, lane) + before[i]);
  });
}

template <class M, class P, class Method>
template <class Columns>
void Tangents<M, P, Method>::take_off_rates(const Side& side, const Columns& columns_of, int used) {
  State rate;
  fit(rate, f_.states);
  rates(x, side, rate);
  for (int lane = 0; lane < used; ++lane)
    for (const int j : columns_of(lane)) {
      if (j < 0) continue;
      double size = 0.0;
      for_each_row(j, [&](int i, int at) {
        P& entry = s[f_.dependence.column_start[j] + at];
        const double left = lanes_of<P>::get(entry, lane) - lanes_of<P>::get(rate[i], lane);
        lanes_of<P>::set(entry, lane, left);
        size += left * f_.inverse_scale(i) * left * f_.inverse_scale(i);
      });
      P& largest = squared_column_size_[j];
      lanes_of<P>::set(largest, lane, std::max(lanes_of<P>::get(largest, lane), size));
    }
}

}  // namespace fisherpoint
