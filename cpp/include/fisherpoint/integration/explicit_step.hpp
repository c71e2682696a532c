// One explicit step of every lane: members of Integrator (integrator.hpp, which includes it at its end). With many states the
// stages do not fit the first-level cache, so that every reading of them counts: they are read once for two stages behind
// them where these have weights for the same ones, and once for both error estimates.
#pragma once

#include <algorithm>
#include <functional>
#include <type_traits>

#include "fisherpoint/integration/sliding.hpp"
#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/integration/tableau.hpp"

namespace fisherpoint {

// The stages, the end and the middle of a step, and its error.
template <class Equation, class Method>
void Integrator<Equation, Method>::attempt_explicit(const State& y, State& middle) {
  on_all_or_first_part(f_, [&]<class Q>(As<Q>) {
    find_stages<Q>(y);
    if (f_.surfaces > 0) find_middle<Q>(y, middle);
  });
  Squares<P> squares;
  judge_stages(y, squares);
  const P embedded = squared_weight() * squares.error, coarse = squares.coarse, size = squares.start + squares.end + 1e-300;
  squared_error_ = method_.squared_error(embedded, squared_weight() * coarse);
  const P least = (least_error * least_error) * squared_weight() * coarse * coarse / size;
  squared_error_ = select(least > squared_error_, least, squared_error_);  // which stays NaN where it is
  told_error_ = squared_error_;
  // Behind a kink f may rise like t^1.5, where the embedded error is that of the step itself, however large the coarse one.
  if (f_.kinks_end > 0) squared_error_ = select(behind_kink_ & (embedded > squared_error_), embedded, squared_error_);
}

template <class Equation, class Method>
template <class Q>
void Integrator<Equation, Method>::find_stages(const State& y) {
  const bool slide = f_.holds_end > 0 && slide_;
  const Side at = slide ? beside<P>(f_, side_, 1.0) : side_;
  const StagesAs<Q, State> stage{{}, stage_};
  const auto& step = read_as<Q>(step_);
  for_each_index(last(), [&](auto previous) {
    const auto s = after(previous);
    State& x = s == before(last()) ? nearest_ : end_;
    const auto put = [&](auto i, const Q& sum) { write_as(x[i], read_as<Q>(y[i]) + step * sum); };
    if constexpr (std::is_same_v<Method, Tableau>)
      sum_stages<Q>(s, put);
    else
      for_each_index(f_.states, [&](auto i) { put(i, weighted_sum(s, method_.a[s], stage, i)); });
    f_.derivative(x, at, stage_[s]);
    if (f_.holds_end > 0 && unforeseen(slide)) this->slide(x, side_, stage_[s]);
  });
}

// put(i, sum) for the sums of stage s of a tableau. Where they begin those of the next stage too, these wait in
// stage_[s + 1], where nothing else is written before the next call.
template <class Equation, class Method>
template <class Q>
void Integrator<Equation, Method>::sum_stages(int s, auto&& put) {
  const StagesAs<Q, State> stage{{}, stage_};
  const int states = f_.states;
  if (method_.begun_before[s]) {
    const Q weight(method_.a[s][s - 1]);
    for (int i = 0; i < states; ++i) put(i, fused(weight, stage[s - 1][i], stage[s][i]));
  } else if (s < last() && method_.begun_before[s + 1]) {
    with_weighted_sums(s, {&method_.a[s], &method_.a[s + 1]}, stage, [&](auto&& with_sums) {
      for (int i = 0; i < states; ++i)
        with_sums(i, [&](const Q& sum, const Q& next) {
          put(i, sum);
          write_as(stage_[s + 1][i], next);
        });
    });
  } else {
    with_weighted_sums(s, {&method_.a[s]}, stage, [&](auto&& with_sums) {
      for (int i = 0; i < states; ++i) with_sums(i, [&](const Q& sum) { put(i, sum); });
    });
  }
}

// The squares of the step's embedded error, of that of a coarser solution, and of the state at both ends. Along long arrays the
// parts of packs follow each other in blocks, which fit the first-level cache: the sums of one part fit the registers.
template <class Equation, class Method>
void Integrator<Equation, Method>::judge_stages(const State& y, Squares<P>& squares) const {
  const auto judge = [&](auto i, const auto& read, auto& of) {
    const StagesBy stage{read, stage_};
    const auto add_square = [&](auto& sum, const auto& value) {
      const auto relative = value * f_.inverse_scale(i);
      sum = fused(relative, relative, sum);
    };
    const auto start = read(y[i]), end = read(end_[i]), step = read(step_);
    add_square(of.error, step * method_.error_of(stage, i));
    add_square(of.coarse, end - start - step * method_.coarse_of(stage, i));
    add_square(of.start, start);
    add_square(of.end, end);
  };
  if constexpr (!std::is_same_v<Method, Tableau>) {
    for_each_index(f_.states, [&](auto i) { judge(i, std::identity{}, squares); });
  } else {
    constexpr int block = 2048 / sizeof(P);  // of each of ten arrays
    for (int first = 0; first < f_.states; first += block)
      for_each_part(f_.parts_in_use(), [&](Part part) {
        Squares<PartOf<P>> of_part{part(squares.error), part(squares.coarse), part(squares.start), part(squares.end)};
        for (int i = first; i < std::min(first + block, f_.states); ++i) judge(i, part, of_part);
        part.set(squares.error, of_part.error);
        part.set(squares.coarse, of_part.coarse);
        part.set(squares.start, of_part.start);
        part.set(squares.end, of_part.end);
      });
  }
}

// The middle of the step, from which surfaces are looked at.
template <class Equation, class Method>
template <class Q>
void Integrator<Equation, Method>::find_middle(const State& y, State& middle) const {
  const StagesAs<Q, State> stage{{}, stage_};
  for_each_index(f_.states, [&](auto i) {
    const Q bow = 0.125 * (stage[0][i] - stage[last()][i]) + method_.bow_of(stage, i);
    write_as(middle[i], fused(read_as<Q>(step_), bow, 0.5 * (read_as<Q>(y[i]) + read_as<Q>(end_[i]))));
  });
}

}  // namespace fisherpoint
