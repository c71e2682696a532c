// The variational equation of a trajectory that slides along several jumps at once (sliding_several.hpp): what
// sliding_tangents.hpp says of one, with as many shares as there are jumps,
//
//     s' = J s + sum_j d_j da_j,    d/dt (h_i,x s + h_i,theta e) = 0 for each of them,
//
// and with as many pivots, the states that follow from the others so that h_i,x s = -h_i,theta e to the last bit.
#pragma once

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/sliding_several.hpp"
#include "fisherpoint/numbers/elimination.hpp"

namespace fisherpoint {

// Of one stage, or of one place on the surfaces.
template <class M, class P>
class SeveralStage {
  using Equation = VariationalEquation<M, P>;
  using State = typename ArraysOf<M, P>::States;
  using Side = typename ArraysOf<M, P>::Sides;
  using Mask = mask_of_lanes<P>;

 public:
  // In these lanes. `rate` and `jacobian` are those on the sides 1 and become those of the slide; turns of the surfaces are
  // over the whole `step`.
  void linearise(const Equation& f, const State& x, const Side& side, const P& step, const Mask& lanes, State& rate,
                 Jacobian<M, P>& jacobian) {
    begin(f, x, side, lanes);
    const Side plus = beside<P>(f, side, 1.0);
    const BesideSteep off(f, x, side);
    ShelfVector<Jacobian<M, P>> changes;
    for (const int m : jumps_) {
      Side tried = plus;
      tried[m] = select(slides<P>(side[m]), P(-1.0), tried[m]);
      State d = rate;
      Jacobian<M, P> change = jacobian;
      f.linearise(off.at(tried), tried, d, change);
      for_each_index(f.states, [&](auto i) { d[i] = rate[i] - d[i]; });
      for (std::size_t e = 0; e < change.by_state.size(); ++e) change.by_state[e] = jacobian.by_state[e] - change.by_state[e];
      for (std::size_t e = 0; e < change.by_theta.size(); ++e) change.by_theta[e] = jacobian.by_theta[e] - change.by_theta[e];
      d_.push_back(d);
      changes.push_back(change);
    }
    ShelfVector<P> share(count());
    for (int i = 0; i < count(); ++i) {
      share[i] = along(normal_[i], rate, f);
      for (int j = 0; j < count(); ++j) system_(i, j) = select(on_[i], along(normal_[i], d_[j], f), P(i == j ? 1.0 : 0.0));
    }
    system_.factorise();
    system_.solve(share.data());
    for (int j = 0; j < count(); ++j) {
      const auto take = [&](auto& to, const auto& change) {
        for (std::size_t e = 0; e < to.size(); ++e) to[e] = select(lanes, to[e] - share[j] * change[e], to[e]);
      };
      take(rate, d_[j]);
      take(jacobian.by_state, changes[j].by_state);
      take(jacobian.by_theta, changes[j].by_theta);
    }
    choose_pivots(f);
    close([](int) { return P(0.0); }, [&](auto&& use) { for_each_index(f.states, use); },
          [&](auto i) -> P& { return rate[i]; });

    constexpr double part = 1e-4;  // of the step
    State before = x, after = x;
    for_each_index(f.states, [&](auto i) {
      before[i] -= part * step * rate[i];
      after[i] += part * step * rate[i];
    });
    for (int i = 0; i < count(); ++i) {
      const auto first = f.jump(jumps_[i], before), second = f.jump(jumps_[i], after);
      for_each_index(f.states, [&](auto k) {
        turn_[i].by_state[k] = select(on_[i], (0.5 / part) * (second.by_state[k] - first.by_state[k]), P(0.0));
      });
      for_each_index(f.parameters, [&](auto k) {
        turn_[i].by_theta[k] = select(on_[i], (0.5 / part) * (second.by_theta[k] - first.by_theta[k]), P(0.0));
      });
    }
  }

  // What the shares add to the rate of a column, of parameter k; returns the squared size of what is cancelled by it.
  P correct(const Equation& f, auto rows, const State& column, int k, State& rate) const {
    ShelfVector<P> rest(count()), share(count());
    for (int i = 0; i < count(); ++i) {
      rest[i] = turn_[i].by_theta[k];
      for_each_variable(rows, [&](auto n) { rest[i] += turn_[i].by_state[n] * column[n]; });
      share[i] = rest[i];
      for_each_variable(rows, [&](auto n) { share[i] += normal_[i].by_state[n] * rate[n]; });
      share[i] = select(on_[i], share[i], P(0.0));
    }
    system_.solve(share.data());
    P cancelled(0.0);
    for_each_variable(rows, [&](auto n) {
      P change(0.0);
      for (int j = 0; j < count(); ++j) change -= d_[j][n] * share[j];
      rate[n] += change;
      cancelled += (change * f.inverse_scale(n)) * (change * f.inverse_scale(n));
    });
    close([&](int i) { return rest[i]; }, [&](auto&& use) { for_each_variable(rows, use); },
          [&](auto n) -> P& { return rate[n]; });
    return cancelled;
  }

  // Takes x and S onto the surfaces in these lanes, along what the surfaces' sides change of f.
  void enter(const Equation& f, const Mask& lanes, State& x, Columns<M, P>& s) const {
    ShelfVector<P> share(count());
    for (int i = 0; i < count(); ++i) share[i] = normal_[i].value;
    system_.solve(share.data());
    for (int j = 0; j < count(); ++j)
      for_each_index(f.states, [&](auto n) { x[n] -= select(lanes, d_[j][n] * share[j], P(0.0)); });
    for_each_index(f.parameters, [&](auto k) {
      P* const column = &s[f.dependence.column_start[k]];
      const auto rows = f.dependence.rows(k);
      for (int i = 0; i < count(); ++i) {
        share[i] = normal_[i].by_theta[k];
        for_each_variable(rows, [&](auto n) { share[i] += normal_[i].by_state[n] * column[detail::below(rows, n)]; });
      }
      system_.solve(share.data());
      for (int j = 0; j < count(); ++j)
        for_each_variable(rows, [&](auto n) { column[detail::below(rows, n)] -= select(lanes, d_[j][n] * share[j], P(0.0)); });
    });
  }

  // Takes x onto the surfaces in some of the lanes, near to where this was made, and S to what is known there.
  void keep_on(const Equation& f, const Mask& lanes, State& x, Columns<M, P>& s) {
    for (int i = 0; i < count(); ++i) {
      on_[i] = on_[i] & lanes;
      take_normal(f, i, x);
    }
    choose_pivots(f);
    State move = x;
    move.fill(P(0.0));
    close([&](int i) { return normal_[i].value; }, [&](auto&& use) { for_each_index(f.states, use); },
          [&](auto i) -> P& { return move[i]; });
    for_each_index(f.states, [&](auto i) { x[i] += move[i]; });
    for_each_index(f.parameters, [&](auto k) {
      P* const column = &s[f.dependence.column_start[k]];
      const auto rows = f.dependence.rows(k);
      close([&](int i) { return normal_[i].by_theta[k]; }, [&](auto&& use) { for_each_variable(rows, use); },
            [&](auto n) -> P& { return column[detail::below(rows, n)]; });
    });
  }

 private:
  int count() const { return static_cast<int>(jumps_.size()); }

  void begin(const Equation& f, const State& x, const Side& side, const Mask& lanes) {
    jumps_ = slid_jumps<P>(f, side, lanes);
    system_ = Elimination<P>(count());
    d_.clear();
    on_.clear();
    normal_.assign(count(), JumpGradient<M, P>(f));
    turn_ = normal_;
    for (int i = 0; i < count(); ++i) {
      on_.push_back(lanes & slides<P>(side[jumps_[i]]));
      take_normal(f, i, x);
    }
  }

  void take_normal(const Equation& f, int i, const State& x) {
    const auto h = f.jump(jumps_[i], x);
    normal_[i].value = select(on_[i], h.value, P(0.0));
    for_each_index(f.states, [&](auto n) { normal_[i].by_state[n] = select(on_[i], h.by_state[n], P(0.0)); });
    for_each_index(f.parameters, [&](auto k) { normal_[i].by_theta[k] = select(on_[i], h.by_theta[k], P(0.0)); });
  }

  static P along(const JumpGradient<M, P>& h, const State& rate, const Equation& f) {
    P sum(0.0);
    for_each_index(f.states, [&](auto n) { sum += h.by_state[n] * rate[n]; });
    return sum;
  }

  // Of each surface one of the states that the jumps move, which it reads most beside those of the surfaces before it.
  void choose_pivots(const Equation& f) {
    State moved, taken;
    fit(moved, f.states);
    fit(taken, f.states);
    moved.fill(P(0.0));
    taken.fill(P(0.0));
    for (const State& d : d_) for_each_index(f.states, [&](auto n) { moved[n] += abs(d[n]); });
    ShelfVector<State> row;
    for (const auto& h : normal_) row.push_back(h.by_state);
    pivot_.assign(count(), taken);
    for (int q = 0; q < count(); ++q) {
      P largest(0.0), left = select(on_[q], P(1.0), P(0.0)), most(0.0);
      const auto weight = [&](auto n) { return select(taken[n] > P(0.5), P(0.0), abs(row[q][n]) * moved[n]); };
      for_each_index(f.states, [&](auto n) { largest = max(largest, weight(n)); });
      for_each_index(f.states, [&](auto n) {
        pivot_[q][n] = select((weight(n) >= largest) & !(taken[n] > P(0.5)), left, P(0.0));
        left -= pivot_[q][n];
        most += pivot_[q][n] * row[q][n];
      });
      for_each_index(f.states, [&](auto n) { taken[n] += pivot_[q][n]; });
      for (int r = q + 1; r < count(); ++r) {
        P share(0.0);
        for_each_index(f.states, [&](auto n) { share += pivot_[q][n] * row[r][n]; });
        share = select(on_[q], share / most, P(0.0));
        for_each_index(f.states, [&](auto n) { row[r][n] -= share * row[q][n]; });
      }
    }
    taken_ = taken;
    pivots_ = Elimination<P>(count());
    for (int i = 0; i < count(); ++i) {
      for (int q = 0; q < count(); ++q) {
        P entry(0.0);
        for_each_index(f.states, [&](auto n) { entry += pivot_[q][n] * normal_[i].by_state[n]; });
        pivots_(i, q) = select(on_[i], entry, P(i == q ? 1.0 : 0.0));
      }
    }
    pivots_.factorise();
  }

  // Sets the pivots' entries such that `rest` plus normal times the entries, of the states that `each` goes through, is zero.
  void close(auto&& rest, auto&& each, auto&& entry) const {
    ShelfVector<P> right(count());
    for (int i = 0; i < count(); ++i) {
      P sum = rest(i);
      each([&](auto n) { sum += select(taken_[n] > P(0.5), P(0.0), normal_[i].by_state[n] * entry(n)); });
      right[i] = select(on_[i], P(0.0) - sum, P(0.0));
    }
    pivots_.solve(right.data());
    for (int q = 0; q < count(); ++q) each([&](auto n) { entry(n) = select(pivot_[q][n] > P(0.5), right[q], entry(n)); });
  }

  ShelfVector<int> jumps_;  // that any of the lanes slides on; what follows is of them
  ShelfVector<Mask> on_;
  ShelfVector<State> d_;
  ShelfVector<JumpGradient<M, P>> normal_, turn_;  // turn: how the normal changes over the whole step, along f
  ShelfVector<State> pivot_;                       // 1 at the pivot, 0 elsewhere
  State taken_;                                    // their sum
  Elimination<P> system_{0}, pivots_{0};           // h_i,x d_j; what h_i reads of pivot q
};

}  // namespace fisherpoint
