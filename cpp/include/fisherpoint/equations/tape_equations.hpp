// The state equation and the variational equation (9) of a tape (tape.hpp).
#pragma once

#include <optional>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/equations/tape_machine.hpp"
#include "fisherpoint/equations/variational_equation.hpp"

namespace fisherpoint {

// Resets of one instant are bits of a number: the lanes in which reset k is among them.
template <class P>
mask_of_lanes<P> has_reset(const P& which, int k) {
  auto found = lanes_of<P>::none();
  for (int lane = 0; lane < lanes_of<P>::width; ++lane)
    lanes_of<P>::set(found, lane, (static_cast<std::uint64_t>(lanes_of<P>::get(which, lane)) >> k) & 1);
  return found;
}

template <class P>
class StateEquation<TapeModel, P> : public Shape<TapeModel> {
  using Array = HeapArray<P>;

 public:
  using Number = P;
  using State = Array;
  using Side = Array;
  using Surfaces = Array;
  using Theta = Array;
  using Input = Array;
  using Output = Array;

  static constexpr bool with_resets = true;

  // `model` must outlive the equation, whose machines refer to what it holds. Where only the first `used` lanes are in use, the
  // others keep what they have at first.
  StateEquation(const StateEquation&) = delete;
  StateEquation(const TapeModel& model, const Theta& theta, const Input& u, int used = lanes_of<P>::width)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        theta_(theta),
        u_(u),
        parts_in_use_(fisherpoint::parts_in_use<P>(used)),
        no_sides_(model.shape().sided_limits ? model.shape().sides : 0),
        rates_(model.programs().rates, model.shape(), theta_, u_, parts_in_use_),
        output_(model.programs().output, model.shape(), theta_, u_, parts_in_use_),
        surfaces_(model.programs().surfaces, model.shape(), theta_, u_, parts_in_use_),
        surface_rates_(model.programs().surface_rates, model.shape(), theta_, u_, parts_in_use_) {
    no_sides_.fill(P(0.0));
  }

  const Dependence<TapeModel>& dependence;
  int parts_in_use() const { return parts_in_use_; }

  void derivative(const State& x, const Side& side, State& dx) const { rates_.run(x, side, dx); }
  int slopes() const { return static_cast<int>(model_.state_entries().size()); }
  std::pair<int, int> slope(int e) const { return {model_.state_entries()[e].row, model_.state_entries()[e].variable}; }
  const EliminationOrder* order() const { return model_.orders().of_states(); }
  const EliminationOrder* stages_order() const { return model_.orders().of_stages(); }
  void jacobian(const State& x, const Side& side, P* entries) const {
    if (!slopes_) slopes_.emplace(model_.programs().state_jacobian, *this, theta_, u_, parts_in_use_);
    slopes_->run(x, side);
    for (int e = 0; e < slopes(); ++e) entries[e] = slopes_->output(e);
  }
  Output output(const State& x) const {
    output_.run(x);
    return outputs_of(output_, outputs);
  }

  // Which conditions of resets hold on these sides: positive where they do.
  State reset_conditions(const State& x, const Side& side) const {
    if (!resets_) resets_.emplace(model_.resets().program, *this, theta_, u_, parts_in_use_);
    resets_->run(x, side);
    return outputs_of(*resets_, resets);
  }
  // Whether reset k counts at a start too where its condition holds.
  bool resets_by_level(int k) const { return model_.resets().by_level[k]; }
  // The states behind the resets that `which` numbers.
  State reset(const State& x, const Side& side, const P& which) const {
    reset_conditions(x, side);
    State after = x;
    int at = resets;
    for (const auto [k, i] : model_.resets().targets) after[i] = select(has_reset(which, k), resets_->output(at++), after[i]);
    return after;
  }

  // The states behind the updates that `which` numbers.
  State update(const State& x, const P& which) const {
    if (!updates_) updates_.emplace(model_.updates().program, *this, theta_, u_, parts_in_use_);
    updates_->run(x);
    State after = x;
    int at = 0;
    for (const auto [k, i] : model_.updates().targets) after[i] = select(has_reset(which, k), updates_->output(at++), after[i]);
    return after;
  }

  double inverse_scale(int i) const { return model_.inverse_scale(i); }

  P squared_size(const State& x) const {
    P sum(0.0);
    on_all_or_first_part(*this, [&]<class Q>(As<Q>) {
      Q of_lanes(0.0);
      for (int i = 0; i < states; ++i) {
        const Q relative = read_as<Q>(x[i]) * model_.inverse_scale(i);
        of_lanes += relative * relative;
      }
      write_as(sum, of_lanes);
    });
    return sum;
  }

  Surfaces surface_values(const State& x, const Side& side) const {
    if (sided_limits)
      surfaces_.run(x, side);
    else
      surfaces_.run(x);
    return outputs_of(surfaces_, surfaces + measured);
  }
  Surfaces surface_values(const State& x) const { return surface_values(x, no_sides_); }
  Surfaces surface_rates(const State& x, const State& dx, const Side& side) const {
    if (sided_limits)
      surface_rates_.run_along(x, dx, side);
    else
      surface_rates_.run_along(x, dx);
    return outputs_of(surface_rates_, surfaces + measured);
  }
  Surfaces surface_rates(const State& x, const State& dx) const { return surface_rates(x, dx, no_sides_); }

 private:
  static Array outputs_of(const Machine<P>& machine, int n) {
    Array values(n);
    for (int i = 0; i < n; ++i) values[i] = machine.output(i);
    return values;
  }

  const TapeModel& model_;
  Theta theta_;
  Input u_;
  int parts_in_use_;  // of packs
  Side no_sides_;
  mutable Machine<P> rates_, output_, surfaces_, surface_rates_;  // each with its own registers: not for two threads
  mutable std::optional<Machine<P>> slopes_, resets_, updates_;
};

template <class P>
class VariationalEquation<TapeModel, P> : public Shape<TapeModel> {
  using Plain = StateEquation<TapeModel, P>;

 public:
  using Number = P;
  using Side = typename Plain::Side;
  using Theta = typename Plain::Theta;
  using Input = typename Plain::Input;
  using State = typename Plain::State;

  static constexpr bool with_resets = true;

  // `model` must outlive the equation, whose machines refer to what it holds.
  VariationalEquation(const VariationalEquation&) = delete;
  VariationalEquation(const TapeModel& model, const Theta& theta, const Input& u, int used = lanes_of<P>::width)
      : Shape<TapeModel>(model.shape()),
        dependence(model.dependence()),
        model_(model),
        theta_(theta),
        u_(u),
        parts_in_use_(fisherpoint::parts_in_use<P>(used)),
        rates_(model.programs().rate_jacobian, model.shape(), theta_, u_, parts_in_use_),
        output_(model.programs().output_jacobian, model.shape(), theta_, u_, parts_in_use_),
        jumps_(model.programs().jump_jacobian, model.shape(), theta_, u_, parts_in_use_) {}

  // x and S behind the resets that `which` numbers.
  void reset(const P& which, State& x, Columns<TapeModel, P>& s) const { set_anew(resets_, model_.resets(), which, x, s); }
  // The same behind updates.
  void update(const P& which, State& x, Columns<TapeModel, P>& s) const { set_anew(updates_, model_.updates(), which, x, s); }

  const Dependence<TapeModel>& dependence;
  int parts_in_use() const { return parts_in_use_; }

  double inverse_scale(int i) const { return model_.inverse_scale(i); }
  const Theta& theta() const { return theta_; }

  void linearise(const State& x, const Side& side, State& dx, Jacobian<TapeModel, P>& jacobian) const {
    linearise(x, side, dx, [&](int e, const P& slope) { jacobian.entry(e) = slope; });
  }
  void linearise(const State& x, const Side& side, State& dx, auto&& put) const {
    rates_.run(x, side);
    for (int i = 0; i < states; ++i) dx[i] = rates_.output(i);
    for (int e = 0; e < dependence.changing + dependence.constant; ++e) put(e, rates_.output(states + e));
  }

  void output(const State& x, const Columns<TapeModel, P>& s, typename Plain::Output& y, ShelfVector<P>& dy_dtheta) const {
    output_.run(x);
    int at = 0;
    for (P& value : y) value = output_.output(at++);
    std::fill(dy_dtheta.begin(), dy_dtheta.end(), P(0.0));
    for (const auto [i, k] : model_.output_entries()) {
      const P slope = output_.output(at++);
      if (k >= states) {
        dy_dtheta[i * parameters + k - states] += slope;
        continue;
      }
      for (int j = 0; j < parameters; ++j)
        if (dependence.depends(k, j))
          dy_dtheta[i * parameters + j] += slope * s[dependence.column_start[j] + detail::below(dependence.rows(j), k)];
    }
  }

  void output_slopes(const State& x, typename Plain::Output& y, auto&& by_state, auto&& by_theta) const {
    output_.run(x);
    int at = 0;
    for (P& value : y) value = output_.output(at++);
    for (const auto [i, k] : model_.output_entries()) {
      const P& slope = output_.output(at++);
      if (k < states)
        by_state(i, k, slope);
      else
        by_theta(i, k - states, slope);
    }
  }

  JumpGradient<TapeModel, P> jump(int which, const State& x) const {
    JumpGradient<TapeModel, P> h(*this);
    jumps_.run(x);
    h.value = jumps_.output(which);
    int at = model_.gradients_end();
    for (const auto [m, k] : model_.jump_entries()) {
      const P slope = jumps_.output(at++);
      if (m == which) (k < states ? h.by_state[k] : h.by_theta[k - states]) = slope;
    }
    return h;
  }

 private:
  void set_anew(std::optional<Machine<P>>& machine, const auto& given, const P& which, State& x,
                Columns<TapeModel, P>& s) const {
    if (!machine) machine.emplace(given.jacobian, *this, theta_, u_, parts_in_use_);
    // What the machine gives may be a state itself, which is about to change.
    const State at_event = x;
    machine->run(at_event);
    const Columns<TapeModel, P> before = s;
    const auto entry = [&](auto& of, int i, int j) -> auto& {
      return of[dependence.column_start[j] + detail::below(dependence.rows(j), i)];
    };
    const int targets = static_cast<int>(given.targets.size());
    for (int t = 0; t < targets; ++t) {
      const auto [k, i] = given.targets[t];
      const auto here = has_reset(which, k);
      x[i] = select(here, machine->output(t), x[i]);
      for (int j = 0; j < parameters; ++j) {
        if (!dependence.depends(i, j)) continue;
        P sum(0.0);
        int at = targets;
        for (const auto [row, variable] : given.entries) {
          const P& slope = machine->output(at++);
          if (row != t) continue;
          if (variable >= states)
            sum += variable - states == j ? slope : P(0.0);
          else if (dependence.depends(variable, j))
            sum += slope * entry(before, variable, j);
        }
        P& column = entry(s, i, j);
        column = select(here, sum, column);
      }
    }
  }

  const TapeModel& model_;
  Theta theta_;
  Input u_;
  int parts_in_use_;  // of packs
  mutable Machine<P> rates_, output_, jumps_;
  mutable std::optional<Machine<P>> resets_, updates_;
};

}  // namespace fisherpoint
