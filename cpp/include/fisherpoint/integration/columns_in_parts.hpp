// Columns of S in parts of packs (column_parts.hpp): members of Tangents (tangents.hpp, at whose end it is included).
#pragma once

#include "fisherpoint/integration/column_parts.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
void Tangents<M, P, Method>::linearise_parts(const State& at, const Side& side, const P& step, State& rate, int s) {
  if constexpr (has_parts) {
    if (!parts_)
      parts_.emplace(method_, f_.dependence.by_state, f_.dependence.by_theta, f_.parameters,
                     f_.parts_in_use() == 1 ? 1 : P::parts);
    const bool may_be_still = f_.dependence.any_closed();
    const Mask still = !(abs(step) > P(0.0));
    const auto stage = parts_->stage(s);
    const auto in_parts = [&](auto parts) {
      f_.linearise(at, side, rate, [&](int e, const P& slope) {
        P change = slope * step;
        if (may_be_still) change = select(still, P(0.0), change);
        for_each_index(parts, [&](int part) { stage.at(part, e) = change.part[part]; });
      });
    };
    parts_->parts() == P::parts ? in_parts(Count<P::parts>{}) : in_parts(Count<1>{});
    for (P& entry : rate) entry *= step;
  }
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::advance_parts() {
  if constexpr (has_parts) {
    parts_->advance(f_.dependence.patterns, s.data(), f_.dependence.column_start, [&](int i) { return f_.inverse_scale(i); });
    for (const ColumnPattern& of : f_.dependence.patterns)
      for (const int k : of.columns) {
        const auto& sums = parts_->sums(k);
        add_column_error(k, {sums.error, sums.coarse}, sums.size);
      }
  }
}

}  // namespace fisherpoint
