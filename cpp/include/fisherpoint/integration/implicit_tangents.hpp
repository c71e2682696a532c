// An implicit step of the variational equation (9), of known size: x by its stages (implicit_step.hpp), then S by their exact
// derivatives. With Z_i what a column s gains up to stage i, and J_i = f_x there,
//     sum_j inverse_ij Z_j - h J_i Z_i = h (J_i s + f_theta),
// which is one linear system for all columns; the last Z is the step's.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/integration/implicit_step.hpp"
#include "fisherpoint/integration/tangents.hpp"
#include "fisherpoint/integration/tolerance.hpp"
#include "fisherpoint/numbers/implicit_orders.hpp"
#include "fisherpoint/numbers/linear_system.hpp"

namespace fisherpoint {

// Moves the x and S of Tangents, and adds to their estimates of errors.
template <class M, class P, class Method>
class ImplicitTangents {
  using Plain = StateEquation<M, P>;
  using Equation = VariationalEquation<M, P>;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  static constexpr int stages = Radau::stages;
  static_assert(stages == ImplicitOrders::stages);
  static constexpr double too_long = 1e4;  // the squared error of a step whose stages are not found

 public:
  ImplicitTangents(const ImplicitTangents&) = delete;  // it refers to itself
  // All but `tolerance` must outlive the object.
  ImplicitTangents(const Plain& states, const Equation& equation, Tangents<M, P, Method>& tangents, const Tolerance& tolerance)
      : f_(equation),
        to_(tangents),
        weight_(tolerance.step_weight()),
        states_(states),
        step_(states),
        n_(states.states),
        system_(stages * n_, states.stages_order(), states.parts_in_use()),
        right_(stages * n_),
        start_(n_),
        column_(n_) {
    for (Jacobian<M, P>& jacobian : jacobian_) jacobian.fit_to(f_.dependence);
    for_each_index(f_.parameters, [&](auto j) {
      driven_.emplace_back();
      for_each_variable(f_.dependence.driven(j), [&](auto i) { driven_.back().push_back(i); });
    });
    for_each_by_state(jacobian_[0], [&](int, int k, const P&) { columns_.push_back(k); });
    at_place_.resize(system_.places());
    for (int r = 0; r < stages; ++r) {
      for (int i = 0; i < n_; ++i)
        for (int q = 0; q < stages; ++q) at_place_[system_.place(r * n_ + i, q * n_ + i)].constant = Radau::inverse[r][q];
      for_each_by_state(jacobian_[r], [&](int i, int k, const P& entry) {
        AtPlace& here = at_place_[system_.place(r * n_ + i, r * n_ + k)];
        here.slope = &entry;
        here.scales = f_.inverse_scale(i) * step_.scale(k);
      });
    }
    fit(rate_, f_.states);
    fit(at_, f_.states);
    fit(side_, f_.sides);
    side_.fill(P(0.0));
  }

  // A lane whose step is 0 stays as it is.
  [[gnu::noinline]] void advance(const P& step, const Side& side) {
    const auto moves = step > P(0.0);
    if (!any(moves)) return;
    for (int m = 0; m < f_.sides; ++m) {
      step_.forget(moves & (abs(side_[m] - side[m]) > P(0.5)));
      side_[m] = select(moves, side[m], side_[m]);
    }
    f_.linearise(to_.x, side, rate_, jacobian_[stages]);
    P sharper(1.0);
    if (f_.holds_end > f_.jumps_end) sharper = sharper_beside_roots<Plain, P>(states_, to_.x, weight_);
    const auto solved = step_.solve(moves, to_.x, rate_, step, side, weight_, sharper);
    const P error = step_.squared_error(lanes_of<P>::none(), to_.x, side, weight_);
    raise(to_.squared_error_, select(moves, select(solved, error, P(too_long) / weight_), P(0.0)));
    for (int r = 0; r < stages; ++r) {
      for (int i = 0; i < n_; ++i) in_parts([&](Part part) { part.set(at_[i], step_.at_stage(part, to_.x, r, i)); });
      f_.linearise(at_, side, rate_, jacobian_[r]);
    }
    system_.factorise([&](int place) {
      const AtPlace& here = at_place_[place];
      return [&](Part part) {
        const PartOf<P> constant(here.constant), scales(here.scales);
        return here.slope ? fused(-(part(step) * part(*here.slope)), scales, constant) : constant;
      };
    });
    for (int j = 0; j < f_.parameters; ++j) advance_column(j, step, moves);
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        part.set(to_.x[i], select(part(moves), step_.at_stage(part, to_.x, stages - 1, i), part(to_.x[i])));
      });
    step_.keep(moves);
  }

 private:
  // use(i, k, entry) for the entries of f_x, use(i, entry) for those of f_theta's column j.
  void for_each_by_state(const Jacobian<M, P>& jacobian, auto&& use) const {
    for_each_index(f_.states, [&](auto i) {
      const auto coupled = f_.dependence.coupled(i);
      for_each_variable(
          coupled, [&](auto k) { use(i, k, jacobian.by_state[f_.dependence.state_start[i] + detail::below(coupled, k)]); });
    });
  }
  void in_parts(auto&& work) const { for_each_part(states_.parts_in_use(), work); }

  // The largest of all steps counts, as in step control: what is stiff forgets errors. NaN where any is.
  static void raise(P& largest, const P& squared_error) { largest += max(P(0.0), squared_error - largest); }

  // h (J s + f_theta) in units of the scales.
  void rates(const Jacobian<M, P>& jacobian, int j, const P& step, P* out) const {
    for (int i = 0; i < n_; ++i) {
      const int first = f_.dependence.state_start[i],
                end = i + 1 < n_ ? f_.dependence.state_start[i + 1] : int{f_.dependence.by_state};
      in_parts([&](Part part) {
        PartOf<P> sum(0.0);
        for (int e = first; e < end; ++e) sum = fused(part(jacobian.by_state[e]), part(column_[columns_[e]]), sum);
        part.set(out[i], sum);
      });
    }
    int at = f_.dependence.theta_start[j];
    for (const int i : driven_[j]) {
      const P& entry = jacobian.by_theta[at++];
      in_parts([&](Part part) { part.set(out[i], part(out[i]) + part(entry)); });
    }
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) { part.set(out[i], part(out[i]) * (part(step) * PartOf<P>(f_.inverse_scale(i)))); });
  }

  void advance_column(int j, const P& step, const mask_of_lanes<P>& moves) {
    std::fill(column_.begin(), column_.end(), P(0.0));
    to_.for_each_row(j, [&](int i, int at) { column_[i] = to_.s[f_.dependence.column_start[j] + at]; });
    for (int r = 0; r < stages; ++r) rates(jacobian_[r], j, step, &right_[r * n_]);
    rates(jacobian_[stages], j, step, start_.data());
    system_.solve(right_.data());
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        auto sum = part(start_[i]);
        for (int r = 0; r < stages; ++r) sum = fused(PartOf<P>(Radau::error[r]), part(right_[r * n_ + i]), sum);
        part.set(start_[i], sum);
      });
    step_.solve_real(start_.data());
    P error(0.0), size(0.0);
    to_.for_each_row(j, [&](int i, int at) {
      P& entry = to_.s[f_.dependence.column_start[j] + at];
      in_parts([&](Part part) {
        const auto before = part(entry), gain = part(right_[(stages - 1) * n_ + i]), off = part(start_[i]);
        const auto value = select(part(moves), fused(PartOf<P>(step_.scale(i)), gain, before), before);
        const auto share = value * PartOf<P>(f_.inverse_scale(i));
        part.set(entry, value);
        part.set(size, fused(share, share, part(size)));
        part.set(error, fused(off, off, part(error)));
      });
    });
    raise(to_.squared_column_error_[j], select(moves, error, P(0.0)));
    to_.squared_column_size_[j] = max(to_.squared_column_size_[j], size);
  }

  const Equation& f_;
  Tangents<M, P, Method>& to_;
  double weight_;
  const Plain& states_;
  ImplicitStep<Plain> step_;
  int n_;
  LinearSystem<P> system_;
  std::vector<std::vector<int>> driven_;  // of every parameter, the states whose rates read it
  std::vector<int> columns_;              // of the entries of f_x
  struct AtPlace {
    double constant = 0.0;  // what is there where nothing moves
    const P* slope = nullptr;
    double scales = 0.0;  // of the slope: the rate's over the state's
  };
  std::vector<AtPlace> at_place_;          // of the system
  ShelfVector<P> right_, start_, column_;  // three stages of a column's gain, its embedded error, and the column
  State rate_, at_;
  Side side_;
  Jacobian<M, P> jacobian_[stages + 1];  // of the stages, then of the step's start
};

}  // namespace fisherpoint
