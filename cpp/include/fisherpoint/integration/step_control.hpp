// The numbers by which the stepping loop decides about steps.
#pragma once

#include <cstddef>

#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

// A trajectory next to a limit leaves the domain if at its rate it would be there within this share of its duration.
inline constexpr double brink = 1e-5;

// A start is on a kink to rounding if it is as near to it as this share of how far the step goes past it.
inline constexpr double rounding = 1e-10;

// On which side of a kink f is taken does not matter for this share of the duration: f is continuous there.
inline constexpr double brief = 1e-9;

// A jump is met within this share of the duration and of the tolerance.
inline constexpr double briefest = 1e-3;

// The size of a column of S, in units of the states' scales, of which the tolerance is rounding: at rest the parts of f cancel,
// and columns are nothing else. By how much a parameter changes, its value tells.
template <class P>
P squared_rounding(const P& theta, double tolerance) {
  const P size = (1e-14 / tolerance) / abs(theta);
  return select(abs(theta) > P(0.0), size * size, P(0.0));
}

// What is taken for a step's squared error. Beside a kink f may rise like t^1.5, and f_x like a root: the error there is the
// embedded one times a number of the method, however large the coarse one.
template <class Method, class P>
P judged(const Method& method, const P& embedded, const P& coarse, const mask_of_lanes<P>& beside) {
  const P judged = method.squared_error(embedded, coarse), rough = method.beside_kink * method.beside_kink * embedded;
  return select(beside & (rough > judged), rough, judged);
}

// The largest of an error and of others in units of their own sizes, all squared; NaN where any is.
template <class P>
P largest_relative_error(const P& squared_error, const auto& squared_errors, const auto& squared_sizes) {
  P sum = squared_error, largest = squared_error;
  for (std::size_t j = 0; j < squared_errors.size(); ++j) {
    const P share = squared_errors[j] / (squared_sizes[j] + 1e-200);
    largest = max(largest, share);
    sum += share;
  }
  return sqrt(select(sum < P(1e300), largest, sum));
}

// A start is on a jump where h is below this share of what states of their natural sizes make of it.
inline constexpr double on_surface = 1e-13;

// Where a root pushes a trajectory back onto its surface from this height, as a share of what states of their natural sizes
// make of it, it is held there. Sensitivities across the surface are off by the root of it.
inline constexpr double hold_height = 1e-12;

// A second surface that comes to hold the trajectory from below this height, or a tenth of the tolerance, does so at once.
inline constexpr double least_distinct_height = 1e-10;

// By how far less than it pushes back from the other side, it may even point away.
inline constexpr double hold_margin = 1e-6;

// And only where it would be back within this share of the duration.
inline constexpr double hold_haste = 1e-3;

// In the place of the side of a jump from which a trajectory comes: its start alone tells.
inline constexpr double unknown_side = 2.0;

// Next to a jump, in tolerances of the time: whether a trajectory has crossed it is not sure.
inline constexpr double next_to_jump = 10.0;

// A crossing's h' is known to a two hundredth where its square is this many times what the tolerance makes of it.
inline constexpr double graze = 100.0;

// By how many tolerances, as a share of itself, what must be positive where g is measured may be off.
inline constexpr double measured_share = 10.0;

// Of two rates of a surface, one that is below this share of the other is rounding.
inline constexpr double alike_rates = 1e-12;

// By how much of what leads onto a jump theta, taken twice, must change what holds a rest there for S to have no value.
inline constexpr double hanging = 1e-8;

// Of a step, over which it is seen how fast what holds a slide changes.
inline constexpr double hold_span = 1e-2;

// Of a step, how far past a kink it is looked.
inline constexpr double glance = 1e-6;

// Surfaces that are met within this share of a step are met in the same instant.
inline constexpr double same_instant = 1e-9;

// A trajectory that gets stuck after so many jumps meets them in ever shorter times.
inline constexpr int many_turns = 25;

// Resets pile up where so many in a row have followed one another ever sooner, the last within this share of the duration.
inline constexpr int few_resets = 3;
inline constexpr double soon = 1e-3;

// A surface's value is nothing but rounding where it is below this share of what it changes by if a state is taken twice.
inline constexpr double noise = 1e-13;

// An embedded error changes its sign at some steps, next to which it says nothing, with few states more often; and behind a
// kink where f rises like t^1.5, that of order 5(4) is a tenth of the error itself. By the coarse solution the error is not
// below this times its square, both relative to x: smooth problems have ten to a hundred times more, at the step where the
// estimate is the tolerance.
inline constexpr double least_error = 0.004;

// What depends on the distance to a surface like a root is not smooth within a step over which that grows or falls by more than
// this factor: S takes several steps there.
inline constexpr double smooth_growth = 4.0;

// From one step to the next, what the error asks for grows by no more than this. Of 10^5 trajectories of x' = p x (1 - x) +
// cos(20 x) one in a thousand was off by more than a hundred tolerances without; with it, fewer steps are tried.
inline constexpr double most_wished = 1.3;

// From this try on it is watched whether stability limits the steps: but from the first one where implicit steps cost little
// more than explicit ones, as unknowns are eliminated in an order of their own (elimination_order.hpp).
inline constexpr int watched_from = 40;

// A pair's steps are limited by stability where the step times the fastest rate is above its bound in so many steps, among
// which no more than the third number in a row are not. With an order, a try that fails behind such a step counts too.
inline constexpr int stiff_signs = 15, stiff_signs_with_order = 2, most_others = 6;

// From this try on it is watched whether the solution is far slower than the model's fastest rate: by how much.
inline constexpr int slowness_watched_from = 400;
inline constexpr double slow = 0.02;

// The squared error that is told where the stages of an implicit step are not found, or the step is too long for a mode that
// grows: it makes the next try about half as long.
inline constexpr double unsolved_error = 110.0;

// By how much implicit steps may grow over what the last one's error asked for.
inline constexpr double most_implicit_wished = 2.5;

// Of a model's time constant, as it is seen at the start, the longest first step.
inline constexpr double most_constants = 1.5;

// And of the time in which the states change by a hundredth, those at zero by a hundredth of a thousandth of their scales. With
// an order most states may be at rest, and this says little.
inline constexpr double most_probes = 1e2, most_probes_with_order = 1e4;

// What is left of the duration is done in one step if it is no longer than this times the next one: step control aims at 0.9 of
// what the tolerance allows.
inline constexpr double last_stretch_with_order = 1.1;

}  // namespace fisherpoint
