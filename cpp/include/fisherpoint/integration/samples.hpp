// States within steps: a member of Integrator (integrator.hpp, which includes it at its end).
#pragma once

#include "fisherpoint/integration/dense_output.hpp"

namespace fisherpoint {

// Notes the states at the instants that lie in a step that is taken, of size `tried` before its end was moved onto a kink.
template <class Equation, class Method>
void Integrator<Equation, Method>::sample(const Mask& taken, const P& tried, const State& y) {
  if constexpr (Method::most_in_error < DenseOutput::first) return;
  const auto due = [&](int lane, const SamplesOfLane& of) {
    return Lanes::get(taken, lane) && of.done < of.at.size() &&
           (Lanes::get(ends_, lane) || of.at[of.done] <= Lanes::get(time_, lane) + Lanes::get(step_, lane));
  };
  bool known = false;
  State more[DenseOutput::more], at;
  Retyped<State, std::array<P, DenseOutput::coefficients>> polynomial;
  while (true) {
    bool any_due = false;
    P share(0.0);
    for (int lane = 0; lane < Lanes::width; ++lane) {
      SamplesOfLane& of = samples_->lanes[lane];
      if (any_stiff_ && due(lane, of) && Lanes::get(implicit_, lane)) of.at = {}, of.missed = true;
      if (!due(lane, of)) continue;
      any_due = true;
      Lanes::set(share, lane, (of.at[of.done] - Lanes::get(time_, lane)) / Lanes::get(tried, lane));
    }
    if (!any_due) return;
    if (!known) {
      known = true;
      const auto stage = [&](int i) {
        return [&, i](int s) { return tried * (s < DenseOutput::first ? stage_[s][i] : more[s - DenseOutput::first][i]); };
      };
      for (State& rate : more) fit(rate, f_.states);
      fit(at, f_.states);
      fit(polynomial, f_.states);
      more[0] = stage_[last()];
      for (int e = 1; e < DenseOutput::more; ++e) {
        for_each_index(f_.states, [&](auto i) { at[i] = DenseOutput::ahead(e, y[i], stage(i)); });
        derivative(at, more[e]);
      }
      for_each_index(f_.states, [&](auto i) {
        const P change = end_[i] - (step_ - tried) * stage_[last()][i] - y[i];
        DenseOutput::fit_polynomial(change, stage(i), [&](int n, const P& value) { polynomial[i][n] = value; });
      });
    }
    for_each_index(f_.states,
                   [&](auto i) { at[i] = y[i] + DenseOutput::change_until(share, [&](int n) { return polynomial[i][n]; }); });
    for (int lane = 0; lane < Lanes::width; ++lane) {
      SamplesOfLane& of = samples_->lanes[lane];
      if (due(lane, of)) get_lane(at, lane, of.x + of.done++ * at.size());
    }
  }
}

}  // namespace fisherpoint
