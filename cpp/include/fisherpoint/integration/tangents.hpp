// A step of the variational equation (9) of known size: first x with the Jacobian of every stage, then the columns of S, one
// parameter after the other. Columns of one pattern share their code, so that it stays in the instruction cache; the stages of
// one column stay in the data cache.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <type_traits>

#include "fisherpoint/equations/variational_equation.hpp"
#include "fisherpoint/integration/column_parts.hpp"
#include "fisherpoint/integration/dense_output.hpp"
#include "fisherpoint/integration/runge_kutta.hpp"
#include "fisherpoint/integration/sliding_tangents.hpp"
#include "fisherpoint/integration/sliding_tangents_several.hpp"
#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/integration/tolerance.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
class ImplicitTangents;
template <class M, class P, class Method>
class SteepTangents;

template <class M, class P, class Method>
class Tangents {
  friend class ImplicitTangents<M, P, Method>;
  friend class SteepTangents<M, P, Method>;

  using Equation = VariationalEquation<M, P>;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using Mask = mask_of_lanes<P>;
  static constexpr bool may_be_dense = Method::most_in_error >= DenseOutput::first;

 public:
  State x;
  Columns<M, P> s;

  // `step_by_step`: the error of every step is kept.
  Tangents(const Equation& equation, const State& x0, const Tolerance& tolerance, bool step_by_step = false)
      : x(x0),
        f_(equation),
        method_(method_of<Method>(tolerance)),
        tolerance_(tolerance.relative),
        step_by_step_(step_by_step) {
    fit(s, f_.dependence.in_columns);
    fit(squared_column_error_, f_.parameters);
    fit(squared_column_size_, f_.parameters);
    fit(coarse_fourth_, f_.parameters);
    for (int s = 0; s < stages(); ++s) jacobian_[s].fit_to(f_.dependence);
    s.fill(P(0.0));
    squared_column_error_.fill(P(0.0));
    coarse_fourth_.fill(P(0.0));
    for (int j = 0; j < f_.parameters; ++j) squared_column_size_[j] = squared_rounding(f_.theta()[j], tolerance_);
  }

  // Where S starts: tangent_starts.hpp.
  //
  // Has S start at these numbers (n_x, p) in a lane, in the place of zero. What no parameter can reach stays zero.
  void start(int lane, const double* from);
  // Where the input switches at the start, in an instant that parameter j moves: f_before is added to its column, and once what
  // is met or set anew in that instant is behind, f on these sides is taken off.
  void add_rate(int lane, int j, const double* before);
  template <class Columns>
  [[gnu::noinline]] void take_off_rates(const Side& side, const Columns& columns_of, int used);

  // The largest estimated error: of x in units of the states' scales, of every column in units of its own size. Against the
  // size of the outputs, columns of weak parameters would be integrated without any control. NaN where anything is.
  // By the coarse solution the error of a column is not below what step_control.hpp says of `least_error`.
  P relative_error() const {
    auto squared_error = squared_column_error_;
    for (int j = 0; j < f_.parameters; ++j) {
      const P least = (least_error * least_error) * coarse_fourth_[j] / (squared_column_size_[j] + P(1e-200));
      squared_error[j] = select(least > squared_error[j], least, squared_error[j]);  // which stays NaN where it is
    }
    return largest_relative_error(squared_error_, squared_error, squared_column_size_);
  }

  // The squared error of the last step, of x or of the column for which it is largest.
  const P& squared_step_error() const { return squared_step_error_; }

  // What a lane has come to, as many numbers: to go on from it in another pack.
  void store_lane(int lane, std::vector<double>& numbers) {
    numbers.clear();
    for_each_number([&](const P& number) { numbers.push_back(lanes_of<P>::get(number, lane)); });
  }
  void load_lane(int lane, const std::vector<double>& numbers) {
    auto next = numbers.begin();
    for_each_number([&](P& number) { lanes_of<P>::set(number, lane, *next++); });
  }
  // And for all lanes, to take steps back that were too long.
  void keep() {
    kept_.clear();
    for_each_number([&](const P& number) { kept_.push_back(number); });
  }
  void take_back(const Mask& lanes) {
    auto next = kept_.begin();
    for_each_number([&](P& number) { number = select(lanes, *next++, number); });
  }

  // A lane whose step is 0 stays as it is; those of `beside` begin or end on a kink. With `dense`, a method's that has it, x
  // and S are known within the step.
  FISHERPOINT_HOT void advance(const P& step, const Side& side, const Mask& beside = lanes_of<P>::none(), bool dense = false) {
    if (!dense && !any(step > P(0.0))) return;
    beside_ = beside;
    dense_ = dense;
    see_slides(side);
    const bool in_parts = has_parts && f_.holds_end == 0 && !dense;
    State rate[Method::most_stages], ahead;
    fit_all(rate, ahead);
    for_each_index(stages(), [&](auto s) {
      for_each_index(f_.states, [&](auto i) { ahead[i] = weighted_sum(s, x[i], method_.a[s], rate, i); });
      if (in_parts) return linearise_parts(ahead, side, step, rate[s], s);
      linearise(ahead, side, step, rate[s], s);
    });
    if constexpr (may_be_dense)
      if (unforeseen(dense_)) extend(step, side, rate);
    Estimate estimate;
    for_each_index(f_.states, [&](auto i) { estimate.add(finish(x[i], rate, i), f_.inverse_scale(i)); });
    squared_error_ += squared(estimate);
    if (step_by_step_) begin_step_error(estimate);
    if (in_parts) return advance_parts();
    for_each_index(f_.parameters, [&](auto j) {
      if (f_.dependence.leader(j) != j) return;
      for (int k = j; k < f_.parameters; k = f_.dependence.next_alike(k)) advance_column(j, k);
    });
    if (slide_) keep_on_slides(step, side);
  }

  // x and S at a share of the last step, which was dense.
  [[gnu::noinline]] void within(const P& share, State& x_there, Columns<M, P>& s_there) const;

  // At jumps: passing.hpp.
  //
  // From one jump to the other side of it, or onto it to slide: where `before` and `after` differ. Returns where the jump is
  // grazed: S grows past all bounds there.
  [[gnu::noinline]] Mask pass(const Side& before, const Side& after);

  // Where S would be another one if the jumps that were met in one instant had been met in another order.
  const Mask& hangs_on_order() const { return hangs_on_order_; }
  // Where theta decides whether it moves on from a jump on which it has come to rest.
  const Mask& hangs_on_balance() const { return hangs_on_balance_; }

  // The same where states are set anew on the way (integration/resets.hpp). With t* the time of that, S + f_before dt*/dtheta
  // is what the states there vary by, which goes through the resets; behind them f_after dt*/dtheta is taken off again.
  mask_of_lanes<P> pass(const Side& before, const Side& after, const auto& resets) {
    if constexpr (has_resets<Equation>) {
      if (any(resets.lanes)) {
        Side calm = before;
        for_each_index(Count<0>{}, f_.jumps_end, [&](auto m) { calm[m] = select(resets.lanes, after[m], before[m]); });
        const auto grazes = pass(calm, after);
        return grazes | set_anew(resets, before, after);
      }
    }
    return pass(before, after);
  }

  // S for the case in which a jump that the trajectory ends next to was met before the end, where it was not, or was not met,
  // where it was: on the sides `other` in the place of `last`. Returns where that is grazed.
  [[gnu::noinline]] Mask exchange(const Side& last, const Side& other);

  // By the scales of the states, entries that are alike in both S as far as `share` of their columns' sizes: those of `other`
  // get the same bits. Returns where any are not.
  mask_of_lanes<P> differs(Tangents& other, double share) const;

 private:
  // What slides: x on its surface, and S with h_x S = -h_theta.
  void keep_on(const JumpGradient<M, P>& h, const Pivot<M, P>& pivot);

  Mask meets(auto m, const Side& before, const Side& after) const;
  [[gnu::noinline]] Mask pass_several(const Mask& lanes, const Side& before, const Side& after);
  void hold_on_several(const Mask& lanes, const Side& after);
  Mask pass_in_order(const Mask& lanes, const Side& before, const Side& after, bool backwards);
  Mask pass_jump(auto m, const Mask& here, const Side& before, const Side& after);
  [[gnu::noinline]] Mask set_anew(const auto& resets, const Side& before, const Side& after);  // reset_tangents.hpp
  [[gnu::noinline]] void advance_briefly(const P& time, const Side& side);
  [[gnu::noinline]] void note_balance(const JumpGradient<M, P>& h, const Mask& lanes, const Side& after, const P& span,
                                      const P& fall);

  // Where f_x has no bounds, it counts as zero for so short a time.
  void linearise_briefly(const State& at, const Side& side, const P& time, State& rate, int s) {
    linearise(at, side, time, rate, s);
    if (!f_.dependence.any_steep()) return;
    for (P& entry : jacobian_[s].by_state) entry = select(abs(entry) < P(1e300), entry, P(0.0));
    for (P& entry : jacobian_[s].by_theta) entry = select(abs(entry) < P(1e300), entry, P(0.0));
  }

  void for_each_row(int j, auto&& use) const {
    int at = 0;
    for (int i = 0; i < f_.states; ++i)
      if (f_.dependence.depends(i, j)) use(i, at++);
  }

  [[gnu::noinline]] void rates(const State& at, const Side& side, State& rate) const {
    Jacobian<M, P> jacobian;
    jacobian.fit_to(f_.dependence);
    const bool slide = any(any_slides<P>(f_, side));
    linearise_ahead(at, side, slide, rate, jacobian);
    if (!slide) return;
    const Mask several = several_slides<P>(f_, side);
    if (any(several)) SeveralStage<M, P>().linearise(f_, at, side, P(0.0), several, rate, jacobian);
    SlidingStage<M, P> stage;
    stage.fit_to(f_);
    slide_linearised(f_, at, side, P(0.0), rate, jacobian, stage, several);
  }

  // What slides on these sides.
  void see_slides(const Side& side) {
    slide_ = f_.holds_end > 0 && any(any_slides<P>(f_, side));
    if (slide_ && f_.holds_end > 1) several_ = several_slides<P>(f_, side);
    if (slide_ && sliding_.empty()) prepare_slides();
    if (any_several() && several_stages_.empty()) several_stages_.resize(stages() + DenseOutput::more);
  }

  [[gnu::noinline]] void keep_on_slides(const P& step, const Side& side);

  // On the sides 1 of what is slid on. The same code whether a neighbour slides or not, and so the same bits.
  void linearise_ahead(const State& at, const Side& side, bool slide, State& rate, Jacobian<M, P>& jacobian) const {
    const Side ahead = slide ? beside<P>(f_, side, 1.0) : side;
    if (!f_.dependence.any_steep()) return f_.linearise(at, ahead, rate, jacobian);
    f_.linearise(unforeseen(slide) ? BesideSteep(f_, at, side).at(ahead) : at, ahead, rate, jacobian);
  }

  bool any_several() const { return f_.holds_end > 1 && slide_ && any(several_); }

  [[gnu::noinline]] void prepare_slides() {
    sliding_.resize(stages() + DenseOutput::more);
    for (auto& stage : sliding_) stage.fit_to(f_);
  }

  // All that the stage adds up, per step; once in the code for all stages, which would overflow the instruction cache.
  FISHERPOINT_HOT void linearise(const State& at, const Side& side, const P& step, State& rate, int s) {
    Jacobian<M, P>& jacobian = jacobian_[s];
    if (f_.holds_end == 0) {
      f_.linearise(at, side, rate, jacobian);
    } else {
      linearise_ahead(at, side, slide_, rate, jacobian);
      if (any_several()) several_stages_[s].linearise(f_, at, side, step, several_, rate, jacobian);
      if (slide_) slide_linearised(f_, at, side, step, rate, jacobian, sliding_[s], several_);
    }
    for (P& entry : rate) entry *= step;
    for (P& entry : jacobian.by_state) entry *= step;
    for (P& entry : jacobian.by_theta) entry *= step;
    if (!f_.dependence.any_steep() && !f_.dependence.any_closed()) return;
    const Mask still = !(abs(step) > P(0.0));  // it may lie where f_x has no bounds
    for (P& entry : jacobian.by_state) entry = select(still, P(0.0), entry);
    for (P& entry : jacobian.by_theta) entry = select(still, P(0.0), entry);
  }

  // What embedded solutions tell about the error of a step, summed over numbers in units of their scales.
  struct Estimate {
    P error{0.0}, coarse{0.0};

    void add(const std::pair<P, P>& differences, double inverse_scale) {
      error += square(inverse_scale * differences.first);
      coarse += square(inverse_scale * differences.second);
    }
  };
  P squared(const Estimate& estimate) const {
    if (f_.kinks_end == 0) return method_.squared_error(estimate.error, estimate.coarse);
    return judged(method_, estimate.error, estimate.coarse, beside_);
  }

  // Of models that are lists of operations, without anything to slide on: columns_in_parts.hpp.
  static constexpr bool has_parts = !Shape<M>::unrolled && lanes_of<P>::width > 1;
  [[gnu::noinline]] void linearise_parts(const State& at, const Side& side, const P& step, State& rate, int s);
  [[gnu::noinline]] void advance_parts();
  void add_column_error(int k, const Estimate& estimate, const P& size) {
    squared_column_error_[k] += squared(estimate);
    coarse_fourth_[k] += square(estimate.coarse);
    squared_column_size_[k] = max(squared_column_size_[k], size);
    if (step_by_step_) add_step_error(estimate, squared_column_size_[k]);
  }

  // Functions of their own, so that the sums above are contracted as without them.
  [[gnu::noinline]] void begin_step_error(const Estimate& of_x) { squared_step_error_ = squared(of_x); }
  [[gnu::noinline]] void add_step_error(const Estimate& of_column, const P& squared_size) {
    const P least = (least_error * least_error) * square(of_column.coarse), size = squared_size + P(1e-200);
    const P error = max(squared(of_column) * size, least) / (size * size);
    squared_step_error_ = select(error <= squared_step_error_, squared_step_error_, error);  // NaN where any is
  }

  // Moves a number to the step's end; returns its differences to the embedded solutions.
  std::pair<P, P> finish(P& value, const State* rate, auto i) const {
    const P change = method_.end_of(rate, i);
    value += change;
    const P coarse = change - method_.coarse_of(rate, i);
    return {method_.error_of(rate, i), coarse};
  }

  void for_each_number(auto&& use) {
    for (P& entry : x) use(entry);
    for (P& entry : s) use(entry);
    use(squared_error_);
    for (auto* const of_columns : {&squared_column_error_, &squared_column_size_, &coarse_fourth_})
      for (P& entry : *of_columns) use(entry);
  }

  auto stages() const { return method_.in_error; }  // that take part in S
  static P square(const P& a) { return a * a; }

  void fit_all_two(State& a, State& b) const {
    fit(a, f_.states);
    fit(b, f_.states);
  }
  void fit_all(State (&rate)[Method::most_stages], State& ahead) const {
    for (int s = 0; s < stages(); ++s) fit(rate[s], f_.states);
    fit(ahead, f_.states);
  }

  // The stages of dense output, and what x does in the step; before it moves to the step's end.
  [[gnu::noinline]] void extend(const P& step, const Side& side, const State* rate);

  // The same for column k, which has the pattern of column j.
  [[gnu::noinline]] void extend_column(auto j, int k, const State* rate);

  static auto of_stages(const State* rate, const State* more, int i) {
    return [=](int s) { return s < DenseOutput::first ? rate[s][i] : more[s - DenseOutput::first][i]; };
  }
  void keep_polynomial(int e, const P& from, const State* rate, const State* more, int i) {
    from_[e] = from;
    const auto stage = of_stages(rate, more, i);
    P change(0.0);
    DenseOutput::fit_polynomial(DenseOutput::ahead(0, change, stage), stage,
                                [&](int n, const P& value) { polynomial_[e][n] = value; });
  }

  // Column k, which has the pattern of column j.
  void advance_column(auto j, int k) {
    const auto rows = f_.dependence.rows(j);
    const auto driven = f_.dependence.driven_in_group(j);
    P* const column = &s[f_.dependence.column_start[k]];
    State rate[Method::most_stages], ahead;  // of the column's states alone
    fit_all(rate, ahead);
    for_each_index(stages(), [&](auto s) {
      for_each_variable(rows, [&](auto i) { ahead[i] = column[detail::below(rows, i)]; });
      add_weighted(s, method_.a[s], rate, rows, ahead);
      const auto& jacobian = jacobian_[s];
      for_each_variable(rows, [&](auto i) {
        P sum(0.0);
        if (detail::has(driven, i)) sum = jacobian.by_theta[f_.dependence.drive_at(k, i)];
        const auto coupled = f_.dependence.coupled(i);
        for_each_variable(both(coupled, rows), [&](auto m) {
          sum += jacobian.by_state[f_.dependence.state_start[i] + detail::below(coupled, m)] * ahead[m];
        });
        rate[s][i] = sum;
      });
      if (f_.holds_end > 0 && unforeseen(slide_)) slide_column(rows, ahead, k, s, rate[s]);
    });
    if constexpr (may_be_dense)
      if (unforeseen(dense_)) extend_column(j, k, rate);
    Estimate estimate;
    P size(0.0);
    for_each_variable(rows, [&](auto i) {
      P& entry = column[detail::below(rows, i)];
      estimate.add(finish(entry, rate, i), f_.inverse_scale(i));
      size += square(entry * f_.inverse_scale(i));
    });
    add_column_error(k, estimate, size);
  }

  // What the Jacobian of stage s makes of `column`, which is column k and has the pattern of column j. As advance_column has it
  // too, where all stages in one function take a third less time.
  [[gnu::noinline]] void column_rate(auto j, int k, auto s, const State& column, State& rate) {
    const auto rows = f_.dependence.rows(j);
    const auto driven = f_.dependence.driven_in_group(j);
    const auto& jacobian = jacobian_[s];
    for_each_variable(rows, [&](auto i) {
      P sum(0.0);
      if (detail::has(driven, i)) sum = jacobian.by_theta[f_.dependence.drive_at(k, i)];
      const auto coupled = f_.dependence.coupled(i);
      for_each_variable(both(coupled, rows), [&](auto m) {
        sum += jacobian.by_state[f_.dependence.state_start[i] + detail::below(coupled, m)] * column[m];
      });
      rate[i] = sum;
    });
    if (f_.holds_end > 0 && unforeseen(slide_)) slide_column(rows, column, k, s, rate);
  }

  [[gnu::noinline]] void slide_column(auto rows, const State& column, int k, int s, State& rate);

  const Equation& f_;
  const Method& method_;
  double tolerance_;
  Mask beside_ = lanes_of<P>::none();        // in this step
  bool slide_ = false;                       // any lane slides in this step
  ShelfVector<SlidingStage<M, P>> sliding_;  // of every stage
  Mask several_ = lanes_of<P>::none();       // slide on several jumps in this step
  ShelfVector<SeveralStage<M, P>> several_stages_;
  ShelfVector<P> entered_;  // S before the last slide
  // Squared estimates, summed over the steps, in units of the states' scales: of the error of x, and of the error and the
  // largest size of every column.
  Mask hangs_on_order_ = lanes_of<P>::none(), hangs_on_balance_ = hangs_on_order_;
  P squared_error_{0.0};
  typename ArraysOf<M, P>::Parameters squared_column_error_, squared_column_size_;
  typename ArraysOf<M, P>::Parameters coarse_fourth_;  // the column's distance to the coarse solution, to the fourth power
  bool step_by_step_;
  P squared_step_error_{0.0};
  ShelfVector<P> kept_;
  std::optional<ColumnParts<P, Method>> parts_;
  Jacobian<M, P> jacobian_[Method::most_in_error + DenseOutput::more];
  // Of the last step, where it was dense: x and then S at its start, and how they go on.
  bool dense_ = false;
  ShelfVector<P> from_;
  ShelfVector<std::array<P, DenseOutput::coefficients>> polynomial_;
};

}  // namespace fisherpoint

#include "fisherpoint/integration/columns_in_parts.hpp"
#include "fisherpoint/integration/dense_tangents.hpp"
#include "fisherpoint/integration/passing.hpp"
#include "fisherpoint/integration/reset_tangents.hpp"
#include "fisherpoint/integration/slid_columns.hpp"
#include "fisherpoint/integration/tangent_starts.hpp"
