// A step of columns of S of a model that is lists of operations: one native vector of the pack after the other, and up to four
// columns together. The Jacobians of all stages are far more than a cache of the first level holds: they are read once for
// these columns, and one vector's share of them stays in a cache of the second level.
#pragma once

#include <vector>

#include "fisherpoint/models/column_patterns.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// Of packs P, by a method.
template <class P, class Method>
class ColumnParts {
  using V = NativeVector;

 public:
  // What the embedded solutions of a column differ by, and its size, squared and in units of the states' scales.
  struct Sums {
    P error, coarse, size;
  };

  // `by_state` entries of f_x and `by_theta` of f_theta, with the zero behind them; of the first `parts` of the packs.
  ColumnParts(const Method& method, int by_state, int by_theta, int columns, int parts)
      : method_(method),
        by_state_(by_state),
        entries_(by_state + by_theta),
        parts_(parts),
        sums_(columns, Sums{P(0.0), P(0.0), P(0.0)}) {
    jacobian_.resize(static_cast<std::size_t>(parts) * method.in_error * entries_);
    for (int part = 0; part < parts; ++part)
      for (int stage = 0; stage < method.in_error; ++stage) jacobian_of(part, stage)[entries_ - 1] = in_all(0.0);
  }

  // Where the Jacobian of a stage, times the step, is to be written: entry e of a part, those of f_x first.
  struct Stage {
    V* first;
    std::size_t apart;

    V& at(int part, int e) const { return first[part * apart + e]; }
  };
  Stage stage(int stage) { return {jacobian_of(0, stage), static_cast<std::size_t>(method_.in_error) * entries_}; }
  int parts() const { return parts_; }
  const Sums& sums(int column) const { return sums_[column]; }

  // Moves columns to the step's end; column j begins at s + start[j].
  [[gnu::noinline]] void advance(const std::vector<ColumnPattern>& patterns, P* s, const std::vector<int>& start,
                                 auto&& inverse_scale) {
    for (int part = 0; part < parts_; ++part)
      for (const ColumnPattern& of : patterns) {
        std::size_t n = 0;
        for_each_index<3>([&](auto halvings) {
          constexpr std::size_t together = 4 >> halvings;
          for (; n + together <= of.columns.size(); n += together)
            advance_together<together>(of, n, part, s, start, inverse_scale);
        });
      }
  }

 private:
  V* jacobian_of(int part, int stage) {
    return &jacobian_[(static_cast<std::size_t>(part) * method_.in_error + stage) * entries_];
  }

  // A number of each of C columns.
  template <int C>
  struct Of {
    V of[C];
  };

  // Columns n to n + C - 1 of a pattern.
  template <int C>
  [[gnu::noinline]] void advance_together(const ColumnPattern& pattern, std::size_t n, int part, P* s,
                                          const std::vector<int>& start, auto&& inverse_scale) {
    const int rows = static_cast<int>(pattern.states.size()), stages = method_.in_error;
    numbers_.resize(static_cast<std::size_t>(stages + 2) * rows * C);
    Of<C>* const from = reinterpret_cast<Of<C>*>(numbers_.data());
    Of<C>* const ahead = from + rows;
    Of<C>* const rate = ahead + rows;
    P* column[C];
    const int* drive[C];
    for (int c = 0; c < C; ++c) {
      column[c] = s + start[pattern.columns[n + c]];
      drive[c] = pattern.drive.data() + (n + c) * rows;
      for (int r = 0; r < rows; ++r) from[r].of[c] = column[c][r].part[part];
    }
    for (int stage = 0; stage < stages; ++stage) {
      add_stages(method_.a[stage], stage, rate, from, rows, ahead);
      const V* const by_state = jacobian_of(part, stage);
      const V* const by_theta = by_state + by_state_;
      const ColumnPattern::Term* term = pattern.terms.data();
      Of<C>* const made = rate + stage * rows;
      for (int r = 0; r < rows; ++r) {
        Of<C> sum;
        for (int c = 0; c < C; ++c) sum.of[c] = by_theta[drive[c][r]];
        for (const ColumnPattern::Term* const end = pattern.terms.data() + pattern.terms_end[r]; term != end; ++term) {
          const V slope = by_state[term->entry];
          const Of<C>& by = ahead[term->row];
          for (int c = 0; c < C; ++c) sum.of[c] = fused(slope, by.of[c], sum.of[c]);
        }
        made[r] = sum;
      }
    }
    const V* of_stages[Method::most_stages];
    for (int stage = 0; stage < stages; ++stage) of_stages[stage] = (rate + stage * rows)->of;
    Of<C> error{}, coarse{}, size{};
    for (int r = 0; r < rows; ++r) {
      const V scale = in_all(inverse_scale(pattern.states[r]));
      for (int c = 0; c < C; ++c) {
        const int at = r * C + c;
        const V change = method_.end_of(of_stages, at), value = from[r].of[c] + change;
        const V off = scale * method_.error_of(of_stages, at), far = scale * (change - method_.coarse_of(of_stages, at));
        const V scaled = value * scale;
        column[c][r].part[part] = value;
        error.of[c] = fused(off, off, error.of[c]);
        coarse.of[c] = fused(far, far, coarse.of[c]);
        size.of[c] = fused(scaled, scaled, size.of[c]);
      }
    }
    for (int c = 0; c < C; ++c) {
      Sums& sums = sums_[pattern.columns[n + c]];
      sums.error.part[part] = error.of[c], sums.coarse.part[part] = coarse.of[c], sums.size.part[part] = size.of[c];
    }
  }

  // sums = from + the weighted sum of the first n stages. A weight is loaded once for some rows.
  template <int C>
  static void add_stages(const auto& weights, int n, const Of<C>* rate, const Of<C>* from, int rows, Of<C>* sums) {
    constexpr int together = 4;
    int r = 0;
    for (; r + together <= rows; r += together) add_to_rows<C, together>(weights, n, rate + r, from + r, rows, sums + r);
    for (; r < rows; ++r) add_to_rows<C, 1>(weights, n, rate + r, from + r, rows, sums + r);
  }
  template <int C, int together>
  static void add_to_rows(const auto& weights, int n, const Of<C>* rate, const Of<C>* from, int rows, Of<C>* sums) {
    Of<C> sum[together];
    for (int r = 0; r < together; ++r) sum[r] = from[r];
    for (int stage = 0; stage < n; ++stage, rate += rows) {
      if (weights[stage] == 0) continue;
      const V weight = in_all(weights[stage]);
      for (int r = 0; r < together; ++r)
        for (int c = 0; c < C; ++c) sum[r].of[c] = fused(weight, rate[r].of[c], sum[r].of[c]);
    }
    for (int r = 0; r < together; ++r) sums[r] = sum[r];
  }

  const Method& method_;
  int by_state_, entries_, parts_;
  ShelfVector<V> jacobian_;  // of every part and stage
  ShelfVector<V> numbers_;
  std::vector<Sums> sums_;
};

}  // namespace fisherpoint
