// Stiff stretches: members of Integrator (integrator.hpp, which includes it at its end). A lane whose explicit steps turn out
// to be limited by stability goes on by implicit ones to the trajectory's end; where it slides along a jump, by explicit ones.
#pragma once

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/step_control.hpp"

namespace fisherpoint {

template <class Equation, class Method>
void Integrator<Equation, Method>::set_stiff(const Mask& lanes) {
  stiff_ = lanes;
  any_stiff_ = any(stiff_);
  if (any_stiff_ && !implicit_step_) implicit_step_.emplace(f_);
}

template <class Equation, class Method>
auto Integrator<Equation, Method>::choose_implicit() -> Mask {
  return implicit_ = running_ & stiff_ & !any_slides<P>(f_, side_);
}

// What attempt_explicit leaves, in the implicit lanes. Slopes are those of the stages' cubic: f itself turns what is left of
// the iteration's error into fast rates.
template <class Equation, class Method>
void Integrator<Equation, Method>::attempt_implicit(const State& y, State& middle) {
  ImplicitStep<Equation>& step = *implicit_step_;
  P sharper(1.0);
  if (f_.holds_end > f_.jumps_end) sharper = sharper_beside_roots<Equation, P>(f_, y, weight_);
  const Mask solved = step.solve(implicit_, y, stage_[0], step_, side_, weight_, sharper);
  Mask fails = step.outgrown(implicit_, stage_[0]) | (implicit_ & !solved);
  const P error = squared_weight() * step.squared_error(rejected_ | (time_ <= P(0.0)), y, side_, weight_);
  for_each_index(f_.states, [&](auto i) {
    for_each_part(f_.parts_in_use(), [&](Part part) {
      part.set(end_[i], select(part(implicit_), step.moved(part, y, i, 1.0), part(end_[i])));
      part.set(stage_[last()][i], select(part(implicit_), step.slope(part, i, 1.0), part(stage_[last()][i])));
    });
  });
  const Mask ends = implicit_ & !fails & (error <= P(1.0));
  if (any(ends)) fails = fails | step.lost(ends, end_, side_, weight_);
  const P unsolved = select(step.unknown(), P(infinity), P(unsolved_error));
  squared_error_ = select(implicit_, select(fails, unsolved, error), squared_error_);
  if (f_.surfaces == 0) return;
  State start;
  fit(start, f_.states);
  for_each_index(f_.states, [&](auto i) {
    for_each_part(f_.parts_in_use(), [&](Part part) {
      part.set(middle[i], select(part(implicit_), step.moved(part, y, i, 0.5), part(middle[i])));
      part.set(start[i], step.slope(part, i, 0.0));
    });
  });
  const Surfaces rate = f_.surface_rates(y, start, side_);
  for_each_index(f_.surfaces, [&](auto m) { rate_[m] = select(implicit_, rate[m], rate_[m]); });
}

// By how much an implicit step may grow, as its error tells.
template <class Equation, class Method>
auto Integrator<Equation, Method>::implicit_wish() const -> P {
  const P eighth_root = sqrt(sqrt(sqrt(squared_error_ + 1e-20)));
  return min(min(0.9 / eighth_root, P(Radau::most_growth)), most_implicit_wished * wished_ / step_);
}

// Between the last two stages, both at the step's end, f changes by its fastest rate times what the states differ by (Hairer,
// Wanner, "Solving ordinary differential equations II", section IV.2). By that rate steps are limited at the bound of
// stability; or with tight tolerances below it, by what the fast rate makes of slow changes: the step is of the length of the
// fastest time constant, and f changes by far less over it than it would if the solution itself were so fast.
template <class Equation, class Method>
void Integrator<Equation, Method>::watch_stiffness(const Mask& taken) {
  const auto squared_distance = [&](const State& a, const State& b) {
    P sum(0.0);
    on_all_or_first_part(f_, [&]<class Q>(As<Q>) {
      Q of_lanes(0.0);
      for_each_index(f_.states, [&](auto i) {
        const Q relative = (read_as<Q>(a[i]) - read_as<Q>(b[i])) * f_.inverse_scale(i);
        of_lanes = fused(relative, relative, of_lanes);
      });
      write_as(sum, of_lanes);
    });
    return sum;
  };
  const double bound = method_.stability * method_.stability;
  // Of the fastest, times the step.
  const P squared_rate =
      step_ * step_ * squared_distance(stage_[last()], stage_[before(last())]) / squared_distance(end_, nearest_);
  Mask limited = squared_rate > P(bound);
  if (outcome_.attempts > slowness_watched_from) {
    const P most = (slow * slow) * squared_rate * f_.squared_size(stage_[0]);
    limited = limited | ((squared_rate > P(0.25)) & (squared_distance(stage_[last()], stage_[0]) < most));
  }
  const Mask watched = taken & running_ & !stiff_, other = watched & !limited;
  Mask sign = watched & limited;
  if (f_.order()) sign = sign | (running_ & !stiff_ & !(squared_error_ <= P(1.0)) & limited & (stiff_signs_ > P(0.0)));
  stiff_signs_ += select(sign, P(1.0), P(0.0));
  others_ = select(sign, P(0.0), others_ + select(other, P(1.0), P(0.0)));
  stiff_signs_ = select(others_ >= P(most_others), P(0.0), stiff_signs_);
  const double enough = f_.order() ? stiff_signs_with_order : stiff_signs;
  const Mask turned = sign & (stiff_signs_ >= P(enough));
  if (any(turned)) set_stiff(stiff_ | turned);
}

}  // namespace fisherpoint
