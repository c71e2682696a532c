// The numbers by which the stepping loop decides about steps.
#pragma once

namespace fisherpoint {

// A trajectory next to a limit leaves the domain if at its rate it would be there within this share of its duration.
inline constexpr double brink = 1e-5;

// A start is on a kink to rounding if it is as near to it as this share of how far the step goes past it.
inline constexpr double rounding = 1e-10;

// On which side of a kink f is taken does not matter for this share of the duration: f is continuous there.
inline constexpr double brief = 1e-9;

// A surface's value is nothing but rounding where it is below this share of what it changes by if a state is taken twice.
inline constexpr double noise = 1e-13;

// An embedded error changes its sign at some steps, next to which it says nothing, with few states more often; and behind a
// kink where f rises like t^1.5, that of order 5(4) is a tenth of the error itself. By the coarse solution the error is not
// below this times its square, both relative to x: smooth problems have ten to a hundred times more, at the step where the
// estimate is the tolerance.
inline constexpr double least_error = 0.004;

// From one step to the next, what the error asks for grows by no more than this. Of 10^5 trajectories of x' = p x (1 - x) +
// cos(20 x) one in a thousand was off by more than a hundred tolerances without; with it, fewer steps are tried.
inline constexpr double most_wished = 1.3;

// Of a model's time constant, as it is seen at the start, the longest first step.
inline constexpr double most_constants = 1.5;

}  // namespace fisherpoint
