// Systems of linear equations, A x = b, in every lane: of a matrix with few entries in the order that is given, the same in all
// lanes (elimination_order.hpp); of a full one, and in the lanes where numbers grow by too much in that order, by rows that
// change places (elimination.hpp).
#pragma once

#include <algorithm>
#include <optional>

#include "fisherpoint/numbers/elimination.hpp"
#include "fisherpoint/numbers/elimination_order.hpp"
#include "fisherpoint/numbers/lanes.hpp"

namespace fisherpoint {

// T: a pack, or a complex number of packs.
template <class T>
class LinearSystem {
  using P = typename detail::NumberOf<T>::type;
  using Mask = mask_of_lanes<P>;
  using First = typename FirstPart<T>::type;
  // Of the numbers that are added up for an entry, against the largest entry of its row: as many digits are lost.
  static constexpr double most_growth = 1e4;

 public:
  // Without an order, of a full matrix (n, n). The order must outlive the system. In an order, the first part of the packs may
  // be all that is solved.
  LinearSystem(int n, const EliminationOrder* order, bool first_part_alone = false)
      : n_(n), first_part_alone_(first_part_alone), order_(order) {
    if (!order_) {
      full_.emplace(n);
      return;
    }
    numbers_.resize(order_->numbers);
    given_.resize(order_->numbers);
  }

  void clear() {
    if (order_)
      std::fill(given_.begin(), given_.end(), detail::zero<T>());
    else
      full_->clear();
  }
  // Where an entry of the matrix is, which must be one of the order's, and the entry.
  int place(int i, int k) const { return order_ ? order_->number(i, k) : i * n_ + k; }
  T& at(int place) { return order_ ? given_[place] : full_->entries()[place]; }

  // Of the matrix as its entries are; they are lost.
  [[gnu::noinline]] void factorise() {
    if (!order_) return full_->factorise();
    numbers_ = given_;
    weak_ = lanes_of<P>::none();
    if (first_part_alone_)
      eliminate<First>();
    else
      eliminate<T>();
    any_weak_ = any(weak_);
    if (any_weak_) fall_back();
  }

  // Of a real matrix that is factorised, the sign of its first k + 1 pivots' product, turned where rows were exchanged; for the
  // last k that of the determinant. Not in the `weak` lanes.
  void signs(P* out) const {
    if (!order_) return full_->signs(out);
    P sign(1.0);
    for (int k = 0; k < n_; ++k) {
      sign = select(numbers_[order_->pivots[k].first] < P(0.0), -sign, sign);
      out[k] = sign;
    }
  }
  // Where rows have changed places though there is an order.
  const Mask& weak() const { return weak_; }

  // b becomes x.
  [[gnu::noinline]] void solve(T* b) const {
    if (!order_) return full_->solve(b);
    if (any_weak_) {
      of_weak_.assign(b, b + n_);
      full_->solve(of_weak_.data());
    }
    if (first_part_alone_)
      solve_as<First>(b);
    else
      solve_as<T>(b);
    for (int i = 0; any_weak_ && i < n_; ++i) b[i] = detail::chosen(weak_, of_weak_[i], b[i]);
  }

 private:
  template <class Q>
  void solve_as(T* b) const {
    for (const auto& pivot : order_->pivots) {
      const int m = static_cast<int>(pivot.rows.size());
      const T* const column = &numbers_[pivot.first] + 1 + m;
      const auto& known = read_as<Q>(b[pivot.row]);
      for (int i = 0; i < m; ++i) {
        T& other = b[pivot.rows[i]];
        write_as(other, detail::less_product(read_as<Q>(other), read_as<Q>(column[i]), known));
      }
    }
    for (auto pivot = order_->pivots.rbegin(); pivot != order_->pivots.rend(); ++pivot) {
      const T* const row = &numbers_[pivot->first];
      Q sum = read_as<Q>(b[pivot->row]);
      for (int i = 0, m = static_cast<int>(pivot->rows.size()); i < m; ++i)
        sum = detail::less_product(sum, read_as<Q>(row[1 + i]), read_as<Q>(b[pivot->rows[i]]));
      write_as(b[pivot->row], detail::product(sum, read_as<Q>(row[0])));
    }
  }

  template <class Q>
  void eliminate() {
    using Real = typename detail::NumberOf<Q>::type;
    ShelfVector<Real> largest(n_);
    auto weak = lanes_of<Real>::none();
    find_largest<Q>(largest);
    for (int k = 0; k < n_; ++k) eliminate<Q>(order_->pivots[k], largest, weak);
    write_as(weak_, weak);
  }

  // The largest entry of every row, by places in the order.
  template <class Q>
  void find_largest(auto& largest) const {
    for (int k = 0; k < n_; ++k) largest[k] = detail::magnitude(read_as<Q>(given_[order_->pivots[k].first]));
    for (int k = 0; k < n_; ++k) {
      const auto& pivot = order_->pivots[k];
      const int m = static_cast<int>(pivot.behind.size());
      const T* const entry = &given_[pivot.first] + 1;
      for (int i = 0; i < m; ++i) {
        auto& of_other = largest[pivot.behind[i]];
        largest[k] = max(largest[k], detail::magnitude(read_as<Q>(entry[i])));
        of_other = max(of_other, detail::magnitude(read_as<Q>(entry[m + i])));
      }
    }
  }

  template <class Q>
  void eliminate(const EliminationOrder::Pivot& pivot, const auto& largest, auto& weak) {
    using Real = typename detail::NumberOf<Q>::type;
    const int m = static_cast<int>(pivot.behind.size());
    T* const diagonal = &numbers_[pivot.first];
    T *const row = diagonal + 1, *const column = row + m;
    Real in_row = detail::magnitude(read_as<Q>(*diagonal));
    weak = weak | ((in_row <= Real(0.0)) & (in_row >= Real(0.0)));
    for (int i = 0; i < m; ++i) in_row = max(in_row, detail::magnitude(read_as<Q>(row[i])));
    const Q inverse = detail::fused_reciprocal(read_as<Q>(*diagonal));
    write_as(*diagonal, inverse);
    const int* target = pivot.targets.data();
    for (int i = 0; i < m; ++i) {
      const Q factor = detail::product(read_as<Q>(column[i]), inverse);
      write_as(column[i], factor);
      weak = weak | (detail::magnitude(factor) * in_row > most_growth * largest[pivot.behind[i]]);
      for (int k = 0; k < m; ++k, ++target) {
        T& entry = numbers_[*target];
        write_as(entry, detail::less_product(read_as<Q>(entry), factor, read_as<Q>(row[k])));
      }
    }
  }

  [[gnu::cold, gnu::noinline]] void fall_back() {
    if (!full_) full_.emplace(n_);
    full_->clear();
    for (const auto& pivot : order_->pivots) {
      const int m = static_cast<int>(pivot.behind.size());
      (*full_)(pivot.row, pivot.row) = given_[pivot.first];
      for (int k = 0; k < m; ++k) {
        const int other = pivot.rows[k];
        (*full_)(pivot.row, other) = given_[pivot.first + 1 + k];
        (*full_)(other, pivot.row) = given_[pivot.first + 1 + m + k];
      }
    }
    full_->factorise();
  }

  int n_;
  bool first_part_alone_;
  const EliminationOrder* order_;
  std::optional<Elimination<T>> full_;
  ShelfVector<T> given_, numbers_;  // entries; once factorised L and U, with the reciprocals of U's diagonal
  mutable ShelfVector<T> of_weak_;
  Mask weak_ = lanes_of<P>::none();
  bool any_weak_ = false;
};

}  // namespace fisherpoint
