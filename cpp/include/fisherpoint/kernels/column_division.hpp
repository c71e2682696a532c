// det(F + W W^T) / det F of many W (p, n), which is what an exchange asks of all candidates: with F = L L^T and G = L^-1 W it
// is det(I + G^T G), the matrix determinant lemma. Columns of all candidates lie side by side, (p, n, N): a lane for each
// candidate.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// W of all candidates: (p, n, N).
struct CandidateColumns {
  int p, n;
  std::size_t count;
  const double* data;
};

// With a lower triangle L (p, p), row after row: L^-1 W of all, and det(F + W W^T) / det F (N,).
void divide_columns(const CandidateColumns& columns, const double* factor, double* out);
void determinant_gains(const CandidateColumns& columns, const double* factor, double* out);

class ColumnDivision {
 public:
  using P = Pack<2 * native_lanes>;

  ColumnDivision(const CandidateColumns& columns, const double* factor)
      : p_(columns.p), n_(columns.n), columns_(columns), factor_(factor), g_(std::size_t(p_) * n_) {}

  void divide(double* out) {
    each_pack([&](std::size_t first, std::size_t lanes) {
      for (std::size_t row = 0; row < g_.size(); ++row) store(g_[row], out + row * columns_.count + first, lanes);
    });
  }

  void gains(double* out) {
    each_pack([&](std::size_t first, std::size_t lanes) { store(determinant(), out + first, lanes); });
  }

 private:
  // Works on packs of candidates, of which it has G.
  void each_pack(auto&& use) {
    for (std::size_t first = 0; first < columns_.count; first += P::width) {
      const std::size_t lanes = std::min<std::size_t>(P::width, columns_.count - first);
      int a = 0;
      for (; a + 4 <= n_; a += 4) substitute(Count<4>{}, a, first, lanes);
      for (; a < n_; ++a) substitute(Count<1>{}, a, first, lanes);
      use(first, lanes);
    }
  }

  // Some columns of G, which are solved together, as each is a chain of operations that wait for one another.
  template <int m>
  void substitute(Count<m>, int a, std::size_t first, std::size_t lanes) {
    for (int i = 0; i < p_; ++i) {
      const double* const row = columns_.data + (std::size_t(i) * n_ + a) * columns_.count + first;
      const double* const l = factor_ + std::size_t(i) * p_;
      P rest[m];
      for (int k = 0; k < m; ++k) rest[k] = load(row + k * columns_.count, lanes);
      for (int j = 0; j < i; ++j)
        for (int k = 0; k < m; ++k) rest[k] -= P(l[j]) * g_[std::size_t(j) * n_ + a + k];
      for (int k = 0; k < m; ++k) g_[std::size_t(i) * n_ + a + k] = P(1.0 / l[i]) * rest[k];
    }
  }

  // Of I + G^T G, or of I + G G^T where that is smaller.
  P determinant() {
    const bool wide = n_ > p_;
    const int size = wide ? p_ : n_, terms = wide ? n_ : p_, along = wide ? 1 : n_, across = wide ? n_ : 1;
    gram_.resize(std::size_t(size) * size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b <= a; ++b) {
        P sum(a == b ? 1.0 : 0.0);
        for (int i = 0; i < terms; ++i)
          sum += g_[std::size_t(i) * along + a * across] * g_[std::size_t(i) * along + b * across];
        gram_[a * size + b] = sum;
      }
    P result(1.0);
    for (int k = 0; k < size; ++k) {
      const P pivot = gram_[k * size + k], inverse = P(1.0) / pivot;
      result *= pivot;
      for (int i = k + 1; i < size; ++i) {
        const P share = gram_[i * size + k] * inverse;
        for (int j = k + 1; j <= i; ++j) gram_[i * size + j] -= share * gram_[j * size + k];
      }
    }
    return result;
  }

  static P load(const double* from, std::size_t lanes) {
    if (lanes == P::width) return P::load(from);
    double padded[P::width] = {};
    std::copy_n(from, lanes, padded);
    return P::load(padded);
  }
  static void store(const P& pack, double* to, std::size_t lanes) {
    if (lanes == P::width) return pack.store(to);
    double all[P::width];
    pack.store(all);
    std::copy_n(all, lanes, to);
  }

  int p_, n_;
  CandidateColumns columns_;
  const double* factor_;
  std::vector<P> g_, gram_;
};

}  // namespace fisherpoint
