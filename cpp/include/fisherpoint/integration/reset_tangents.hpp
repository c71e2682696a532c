// S where states are set anew (resets.hpp): a member of Tangents (tangents.hpp, which includes it at its end).
//
// The trajectory is taken onto the jump that is met, through the resets, and back in time. Returns where the jump is grazed.
#pragma once

namespace fisherpoint {

template <class M, class P, class Method>
mask_of_lanes<P> Tangents<M, P, Method>::set_anew(const auto& resets, const Side& before, const Side& after) {
  State rate, rate_behind;
  fit_all_two(rate, rate_behind);
  P time(0.0), fall(1.0), size(1.0);
  const auto met = [&](auto m) { return resets.lanes & (abs(resets.surface - P(double(m))) < P(0.5)); };
  const auto growth = [&](const JumpGradient<M, P>& h, const State& along) {
    P sum(0.0);
    for_each_index(f_.states, [&](auto i) { sum += h.by_state[i] * along[i]; });
    return sum;
  };
  const auto for_each_met = [&](auto&& use) {
    for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
      if (const auto here = met(m); any(here)) use(here, f_.jump(m, x));
    });
  };
  rates(x, before, rate);
  for_each_met([&](const auto& here, const auto& h) {
    const P speed = growth(h, rate);
    time = select(here & (abs(speed) > P(0.0)), -h.value / speed, time);
  });
  advance_briefly(time, before);
  rates(x, before, rate);
  ShelfVector<P> shift(f_.parameters, P(0.0));  // of the time of the event, by every parameter
  auto unknown = lanes_of<P>::none();           // a slide that opens has no h that tells its time
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { unknown = unknown | (met(m) & slides(before[m])); });
  for_each_met([&](const auto& here, const auto& h) {
    const P speed = growth(h, rate);
    fall = select(here, speed, fall);
    P natural(0.0);
    for_each_index(f_.states, [&](auto i) { natural += abs(h.by_state[i]) * (1.0 / f_.inverse_scale(i)); });
    size = select(here, natural, size);
    for (int j = 0; j < f_.parameters; ++j) {
      P sum = h.by_theta[j];
      for_each_row(j, [&](int i, int at) { sum += h.by_state[i] * s[f_.dependence.column_start[j] + at]; });
      shift[j] = select(here, P(0.0) - sum / speed, shift[j]);
    }
  });
  State ahead = x, rate_ahead = rate;
  const P span = 1e-6 * size / (abs(fall) + P(1e-300));
  for_each_index(f_.states, [&](auto i) { ahead[i] += span * rate[i]; });
  rates(ahead, before, rate_ahead);
  P bend(0.0);
  for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) {
    const auto here = met(m);
    if (any(here)) bend = select(here, abs(growth(f_.jump(m, ahead), rate_ahead) - fall) / span, bend);
  });
  const auto move = [&](const State& along, double sign) {
    for (int j = 0; j < f_.parameters; ++j)
      for_each_row(j, [&](int i, int at) {
        P& entry = s[f_.dependence.column_start[j] + at];
        entry = select(resets.lanes, entry + sign * along[i] * shift[j], entry);
      });
  };
  move(rate, 1.0);
  for (const P& which : resets.which) f_.reset(which, x, s);
  rates(x, after, rate_behind);
  move(rate_behind, -1.0);
  advance_briefly(-time, after);
  return unknown | (resets.lanes & (bend > P(0.0)) & !(fall * fall > graze * tolerance_ * size * bend));
}

}  // namespace fisherpoint
