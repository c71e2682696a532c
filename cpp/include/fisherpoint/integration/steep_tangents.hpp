// S beside surfaces where f_x has no bounds, as f takes a root of what is zero there: a flow through an orifice that reverses.
// f_x grows like t^(e - 1) with the time t to the surface and a power 0 < e < 1, which has an integral. So the last step before
// such a surface, and the first one behind it, are made of ones that each take a part of what is left of the way. The rest of
// it, over which S does not change to speak of, is a sum over nodes in the third root of t, where what is added up is smooth.
//
// Steps are found from the distance as this trajectory has it, which differs from the states' by their errors: where it meets
// the surface earlier or later, the step behind it makes up for that.
#pragma once

#include <algorithm>
#include <array>

#include "fisherpoint/integration/implicit_tangents.hpp"
#include "fisherpoint/integration/tangents.hpp"

namespace fisherpoint {

// Moves the x and S of Tangents.
template <class M, class P, class Method>
class SteepTangents {
  using Equation = VariationalEquation<M, P>;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Mask = mask_of_lanes<P>;
  static constexpr int most_steps = 2000;
  // Shares of what states of their natural sizes make of h: nearer than this rounding counts, or at rest.
  static constexpr double nearest = 1e-11;
  static constexpr double least_move = 1e-16;  // what moves by less stays where it is
  static constexpr std::array nodes = {0.0694318442029737, 0.3300094782075719, 0.6699905217924281, 0.9305681557970263};
  static constexpr std::array weights = {0.1739274225687269, 0.3260725774312731, 0.3260725774312731, 0.1739274225687269};

 public:
  // All but `tolerance` must outlive the object; `implicit` takes implicit steps, where paths have such.
  SteepTangents(const Equation& equation, Tangents<M, P, Method>& tangents, ImplicitTangents<M, P, Method>* implicit,
                double tolerance)
      : f_(equation), to_(tangents), implicit_(implicit), most_(std::max(0.1 * tolerance, hold_height)) {
    fit(rate_, f_.states);
    fit(at_, f_.states);
  }

  // A step, implicit in some lanes. Where these are next to a surface that holds them, it goes along that.
  void advance(const P& size, const Side& side, const Mask& implicit, const Mask& beside = lanes_of<P>::none(),
               bool dense = false) {
    Mask held = lanes_of<P>::none();
    if (implicit_ && any(implicit)) {
      Side on = side;
      held = step_off(select(implicit, size, P(0.0)), side, on);
      if (any(held)) {
        to_.pass(side, on);
        to_.advance(select(held, size, P(0.0)), on);
      }
      implicit_->advance(select(implicit & !held, size, P(0.0)), side);
    }
    to_.advance(select(implicit | held, P(0.0), size), side, beside, dense);
  }

  // A step onto the surfaces whose sides differ on the steps behind it, in lanes where `size` is not 0; by implicit steps in
  // those of `implicit`.
  [[gnu::noinline]] void approach(const P& size, const Side& side, const Side& behind, const P& part, const Mask& implicit) {
    Mask lanes = size > P(0.0);
    if (!any(lanes)) return;
    P left = select(lanes, max(size + lag_, P(0.0)), P(0.0));
    lag_ = select(lanes, size + lag_ - left, lag_);
    // Where it is held there, S is taken onto the surface behind this step.
    const Mask held = holds(lanes, side, behind);
    Met met = look(lanes, side, behind, behind);
    const Mask rests = lanes & !held & (abs(met.value) <= nearest * met.size) & (abs(met.rate) * size <= nearest * met.size);
    if (any(rests)) {  // it lies there, or is there too shortly to move
      const Mask moves = rests & (abs(met.rate) * left > least_move * met.size), falls = met.rate < P(0.0);
      add_up(select(moves & falls, left, P(0.0)), -1.0, met.rates, side);
      add_up(select(moves & !falls, left, P(0.0)), 1.0, met.rates, side);
      for (int i = 0; i < f_.states; ++i) to_.x[i] += select(moves, left, P(0.0)) * met.rates[i];
      to_.advance(select(rests & !moves, left, P(0.0)), side);
      lanes = lanes & !rests;
    }
    // It may begin on such a surface and end there, as where b of max(x, 0)^b is 1.
    const Mask rises = lanes & !(met.value > nearest * met.size) & (met.rate > P(0.0));
    if (any(rises)) {
      const P half = select(rises, 0.5 * left, P(0.0));
      rise(half, side, met, part, implicit);
      left -= half;
      met = look(lanes, side, behind, behind);
    }
    for (int k = 0; k < most_steps; ++k) {
      const Mask far = lanes & (met.value > nearest * met.size);
      if (!any(far)) break;
      const P distance = -met.value / met.rate;
      const Mask known = (met.rate < P(0.0)) & ((distance <= 2.0 * left) | (left <= 1e-3 * size));
      const P step = select(far, part * select(known, distance, left), P(0.0));
      advance(step, side, implicit);
      left -= step;
      met = look(lanes, side, behind, behind);
    }
    // Where f behind the surface does not move it, it comes to rest.
    const Mask falls = lanes & !held & (met.rate < P(0.0)) & (met.value > P(0.0));
    const Mask stops = falls & (abs(met.rate_behind) <= 1e-3 * abs(met.rate));
    const P rest = select(falls, -met.value / met.rate, P(0.0));
    for (int i = 0; i < f_.states; ++i) to_.x[i] += rest * met.rates[i];
    add_up(select(falls & !stops, rest, P(0.0)), -1.0, met.rates, side);
    if (any(stops)) settle(stops, met);
    lag_ += select(lanes, left - rest, P(0.0));
  }

  // A step off the surfaces whose sides differ on the steps before it.
  [[gnu::noinline]] void leave(const P& size, const Side& side, const Side& before, const P& part, const Mask& implicit) {
    const Mask lanes = size > P(0.0);
    if (!any(lanes)) return;
    const P whole = select(lanes, max(size + lag_, 1e-6 * size), P(0.0));
    lag_ = select(lanes, size - whole + lag_, lag_);
    const Met met = look(lanes, side, before, side);
    rise(whole, side, met, part, implicit);
  }

  // A step behind a surface, with what the way there took less, or more.
  P made_up(const P& size) {
    const P whole = max(size + lag_, P(0.0));
    lag_ = select(size > P(0.0), size + lag_ - whole, lag_);
    return select(size > P(0.0), whole, size);
  }

 private:
  // Of implicit steps next to a surface: where it holds this trajectory, a little before or behind the states', its side is 0
  // on `held`, and these lanes are returned. The others are to begin where f_x is finite, beside the surface or where the root
  // balances what drives it.
  [[gnu::noinline]] Mask step_off(const P& size, const Side& side, Side& held) {
    Mask holds = lanes_of<P>::none();
    for_each_index(f_.jumps_end, f_.holds_end, [&](auto m) {
      const auto h = f_.jump(m, to_.x);
      P scale(0.0);
      for_each_index(f_.states, [&](auto i) { scale += abs(h.by_state[i]) * (1.0 / f_.inverse_scale(i)); });
      Mask near = (size > P(0.0)) & !slides(side[m]) & (side[m] * h.value < hold_height * scale);
      if (!any(near)) return;
      const int here = m;
      const BesideSteep off(f_, to_.x, 1.0, [&](int n) { return n == here ? near : near & slides(side[n]); });
      Side at = side, on_side = side;
      const P own = h.value / scale;
      const auto growth = [&](const P& share) {
        at[m] = on_side[m] * share - own;
        to_.rates(off.at(at, here), on_side, rate_);
        P sum(0.0);
        for_each_index(f_.states, [&](auto i) { sum += h.by_state[i] * rate_[i]; });
        return on_side[m] * sum;
      };
      const auto further = [&](const P& share) { return growth(share) > P(0.0); };
      const P ahead = growth(P(hold_height));
      on_side[m] = -side[m];
      const State rate_ahead = rate_;
      const P behind = growth(P(hold_height)), margin = -hold_margin * (ahead + behind);
      on_side[m] = side[m];
      State d = rate_;
      for_each_index(f_.states, [&](auto i) { d[i] -= rate_ahead[i]; });
      const Mask back = near & (ahead < margin) & (behind < margin);
      held[m] = select(back, P(0.0), held[m]);
      holds = holds | back;
      near = near & !back;
      // Beyond the highest place at which the states' steps begin it moves away in its own time.
      const Mask balances = near & !further(P(most_)) & further(P(hold_height));
      P low(hold_height), high = select(balances, P(most_), P(hold_height));
      for (int k = 0; k < 10 && any(balances); ++k) {
        const P middle = sqrt(low * high);
        const Mask on = further(middle);
        low = select(on, middle, low);
        high = select(on, high, middle);
      }
      at[m] = side[m] * sqrt(low * high) - own;
      at[m] = select(near, at[m], P(0.0));
      to_.x = off.at(at, here);
      if (any(balances)) balance(balances, h.by_state, d, side);
    });
    return holds;
  }

  // The surface that a lane meets, as seen from its side: its value and rate, f, and its rate by f on other sides.
  struct Met {
    P value{0.0}, rate{0.0}, rate_behind{0.0}, size{0.0};
    State rates, normal;
    typename ArraysOf<M, P>::Parameters by_theta;
  };

  // Off a surface, for some time: by steps that each take a part of the time since.
  void rise(const P& whole, const Side& side, const Met& met, const P& part, const Mask& implicit) {
    // From a limit, of which there is no gradient, it has moved after any time.
    const P reach = select(met.size > P(0.0), nearest * met.size / abs(met.rate), P(0.0));
    const Mask moves = reach < 0.1 * whole;
    const Mask at_once = !moves & (met.rate * whole > least_move * met.size);  // in all of the time it moves no further
    const P first = select(moves, max(reach, 1e-11 * whole), select(at_once, whole, P(0.0)));
    if (any(moves | at_once)) {
      add_up(first, 1.0, met.rates, side);
      for (int i = 0; i < f_.states; ++i) to_.x[i] += first * met.rates[i];
    }
    P done = first;
    for (int k = 0; k < most_steps; ++k) {
      const P step = select(moves, min((part / (1.0 - part)) * done, whole - done), whole - done);
      if (!any(step > P(0.0))) break;
      advance(step, side, implicit);
      done += step;
    }
    const P step = whole - done;
    if (any(step > P(0.0))) advance(step, side, implicit);
  }

  // S where the root balances what drives the trajectory: h_x S does so too, which it comes to at once.
  void balance(const Mask& lanes, const State& normal, const State& d, const Side& side) {
    to_.see_slides(side);
    to_.linearise(to_.x, side, P(1.0), rate_, 0);
    for_each_index(f_.parameters, [&](auto j) {
      if (f_.dependence.leader(j) != j) return;
      for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) {
        const auto rows = f_.dependence.rows(j);
        P* const column = &to_.s[f_.dependence.column_start[k]];
        P growth[2] = {P(0.0), P(0.0)};
        for (const int with : {0, 1}) {
          for_each_variable(rows, [&](auto i) { at_[i] = column[detail::below(rows, i)] + with * d[i]; });
          to_.column_rate(j, k, 0, at_, rate_);
          for_each_variable(rows, [&](auto i) { growth[with] += normal[i] * rate_[i]; });
        }
        const P share = growth[0] / (growth[0] - growth[1]);
        const Mask known = lanes & (abs(share) < P(1e300));
        for_each_variable(rows, [&](auto i) { column[detail::below(rows, i)] += select(known, share * d[i], P(0.0)); });
      }
    });
  }

  // Of these lanes those whose next side is that of a hold.
  Mask holds(const Mask& lanes, const Side& side, const Side& next) const {
    Mask found = lanes_of<P>::none();
    for_each_index(f_.jumps_end, f_.holds_end, [&](auto m) { found = found | (lanes & slides(next[m]) & !slides(side[m])); });
    return found;
  }

  Met look(const Mask& lanes, const Side& side, const Side& other, const Side& behind) {
    Met met;
    fit(met.rates, f_.states);
    fit(met.normal, f_.states);
    fit(met.by_theta, f_.parameters);
    met.normal.fill(P(0.0));
    met.by_theta.fill(P(0.0));
    State rates_behind;
    fit(rates_behind, f_.states);
    to_.rates(to_.x, side, met.rates);
    to_.rates(to_.x, behind, rates_behind);
    for_each_index(Count<0>{}, f_.kinks_end, [&](auto m) {
      if (!f_.dependence.steep(m)) return;
      const Mask here = lanes & !slides(side[m]) & (abs(side[m] - other[m]) > P(0.5));
      if (!any(here)) return;
      const auto h = f_.jump(m, to_.x);
      P rate(0.0), rate_behind(0.0), size(0.0);
      for_each_index(f_.states, [&](auto i) {
        rate += h.by_state[i] * met.rates[i];
        rate_behind += h.by_state[i] * rates_behind[i];
        size += abs(h.by_state[i]) * (1.0 / f_.inverse_scale(i));
        met.normal[i] = select(here, h.by_state[i], met.normal[i]);
      });
      for_each_index(f_.parameters, [&](auto j) { met.by_theta[j] = select(here, h.by_theta[j], met.by_theta[j]); });
      met.value = select(here, side[m] * h.value, met.value);
      met.rate = select(here, side[m] * rate, met.rate);
      met.rate_behind = select(here, side[m] * rate_behind, met.rate_behind);
      met.size = select(here, size, met.size);
    });
    return met;
  }

  // Adds what S gains over a time from, or with `sense` -1 up to, where x lies on the surface; x stays there.
  void add_up(const P& time, double sense, const State& rates, const Side& side) {
    if (!any(time > P(0.0))) return;
    ShelfVector<P> gain(to_.s.size(), P(0.0));
    const State x = to_.x;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const double share = nodes[n] * nodes[n] * nodes[n], weight = 3.0 * nodes[n] * nodes[n] * weights[n];
      for (int i = 0; i < f_.states; ++i) at_[i] = x[i] + (sense * share) * time * rates[i];
      to_.slide_ = false;
      to_.linearise(at_, side, weight * time, rate_, 0);
      for_each_index(f_.parameters, [&](auto j) {
        if (f_.dependence.leader(j) != j) return;
        for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) {
          const auto rows = f_.dependence.rows(j);
          const int start = f_.dependence.column_start[k];
          for_each_variable(rows, [&](auto i) { at_[i] = to_.s[start + detail::below(rows, i)]; });
          to_.column_rate(j, k, 0, at_, rate_);
          for_each_variable(rows, [&](auto i) { gain[start + detail::below(rows, i)] += rate_[i]; });
        }
      });
    }
    for (std::size_t e = 0; e < gain.size(); ++e) to_.s[e] += select(time > P(0.0), gain[e], P(0.0));
  }

  // Where h stays zero, whatever theta: S moves along f, such that h_x S = -h_theta.
  void settle(const Mask& lanes, const Met& met) {
    P fall(0.0);
    for_each_index(f_.states, [&](auto i) { fall += met.normal[i] * met.rates[i]; });
    Pivot<M, P> pivot;
    pivot.fit_to(f_);
    pivot.choose(f_, lanes, met.normal, met.rates);
    for (int j = 0; j < f_.parameters; ++j) {
      P* const column = &to_.s[f_.dependence.column_start[j]];
      P shift = met.by_theta[j];
      to_.for_each_row(j, [&](int i, int at) { shift += met.normal[i] * column[at]; });
      const P share = select(lanes, shift / fall, P(0.0));
      to_.for_each_row(j, [&](int i, int at) { column[at] -= met.rates[i] * share; });
    }
    for_each_index(f_.parameters, [&](auto j) {
      P* const column = &to_.s[f_.dependence.column_start[j]];
      const auto rows = f_.dependence.rows(j);
      pivot.close(
          met.normal, met.by_theta[j], [&](auto&& use) { for_each_variable(rows, use); },
          [&](auto i) -> P& { return column[detail::below(rows, i)]; });
    });
  }

  const Equation& f_;
  Tangents<M, P, Method>& to_;
  ImplicitTangents<M, P, Method>* implicit_;
  double most_;  // the greatest height at which the states' implicit steps begin
  P lag_{0.0};   // by how much later, or earlier, the surface was met
  State rate_, at_;
};

}  // namespace fisherpoint
