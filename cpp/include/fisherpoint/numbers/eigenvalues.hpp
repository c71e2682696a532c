// How many eigenvalues of a matrix are on the left of the imaginary axis.
#pragma once

#include "fisherpoint/numbers/elimination.hpp"
#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

namespace detail {

template <class P>
P squared_norm(const ShelfVector<P>& entries) {
  P sum(0.0);
  for (const P& entry : entries) sum += entry * entry;
  return sum;
}

}  // namespace detail

// Of a real matrix (n, n), which is lost, in every lane: half of n minus the trace of its sign, which Newton's iteration finds
// from (a + a^-1) / 2 (N. J. Higham, "Functions of matrices", 2008, section 5.3). No whole number where an eigenvalue is on the
// axis, NaN where an entry is.
template <class P>
[[gnu::noinline]] P eigenvalues_on_left(ShelfVector<P>& a, int n) {
  constexpr int most_iterations = 60;
  constexpr double resolved = 1e-12;  // squared, of what an iteration changes: the next one changes its square
  Elimination<P> system(n);
  ShelfVector<P> inverse(n * n), column(n);
  auto iterates = P(0.0) <= P(0.0);
  for (int count = 0; count < most_iterations && any(iterates); ++count) {
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) system(i, k) = a[i * n + k];
    system.factorise();
    for (int k = 0; k < n; ++k) {
      for (int i = 0; i < n; ++i) column[i] = P(i == k ? 1.0 : 0.0);
      system.solve(column.data());
      for (int i = 0; i < n; ++i) inverse[i * n + k] = column[i];
    }
    // Both of one size, in which far eigenvalues come near within a few iterations.
    const P size = detail::squared_norm(a), ratio = sqrt(sqrt(detail::squared_norm(inverse) / size));
    P change(0.0);
    for (int j = 0; j < n * n; ++j) {
      const P next = 0.5 * (ratio * a[j] + inverse[j] / ratio);
      const P by = next - a[j];
      change += by * by;
      a[j] = select(iterates, next, a[j]);
    }
    iterates = iterates & (change > resolved * size);
  }
  P trace(0.0);
  for (int i = 0; i < n; ++i) trace += a[i * n + i];
  return 0.5 * (P(n) - trace);
}

}  // namespace fisherpoint
