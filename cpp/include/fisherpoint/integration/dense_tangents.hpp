// x and S within a step, by the polynomials of dense output: members of Tangents (tangents.hpp, at whose end it is included).
#pragma once

#include "fisherpoint/integration/dense_output.hpp"

namespace fisherpoint {

template <class M, class P, class Method>
void Tangents<M, P, Method>::within(const P& share, State& x_there, Columns<M, P>& s_there) const {
  const auto entry = [&](std::size_t e) {
    const auto& of = polynomial_[e];
    return from_[e] + DenseOutput::change_until(share, [&](int n) { return of[n]; });
  };
  for (std::size_t i = 0; i < x_there.size(); ++i) x_there[i] = entry(i);
  for (std::size_t e = 0; e < s_there.size(); ++e) s_there[e] = entry(x_there.size() + e);
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::extend(const P& step, const Side& side, const State* rate) {
  if (polynomial_.empty()) {
    for (int e = 0; e < DenseOutput::more; ++e) jacobian_[stages() + e].fit_to(f_.dependence);
    polynomial_.resize(f_.states + f_.dependence.in_columns);
    from_.resize(polynomial_.size());
  }
  State more[DenseOutput::more], ahead;
  fit(ahead, f_.states);
  for (int e = 0; e < DenseOutput::more; ++e) {
    fit(more[e], f_.states);
    for (int i = 0; i < f_.states; ++i) ahead[i] = DenseOutput::ahead(e, x[i], of_stages(rate, more, i));
    linearise(ahead, side, step, more[e], stages() + e);
  }
  for (int i = 0; i < f_.states; ++i) keep_polynomial(i, x[i], rate, more, i);
}

template <class M, class P, class Method>
void Tangents<M, P, Method>::extend_column(auto j, int k, const State* rate) {
  const auto rows = f_.dependence.rows(j);
  const int start = f_.dependence.column_start[k];
  State more[DenseOutput::more], ahead;
  fit(ahead, f_.states);
  for (int e = 0; e < DenseOutput::more; ++e) {
    fit(more[e], f_.states);
    int at = start;
    for_each_row(j, [&](int i, int) { ahead[i] = DenseOutput::ahead(e, s[at++], of_stages(rate, more, i)); });
    column_rate(j, k, stages() + e, ahead, more[e]);
  }
  for_each_variable(rows, [&](auto i) {
    const int at = start + detail::below(rows, i);
    keep_polynomial(f_.states + at, s[at], rate, more, i);
  });
}

}  // namespace fisherpoint
