// Systems of linear equations, A x = b, in every lane: of a matrix with few entries in the order that is given, the same in all
// lanes (elimination_order.hpp); of a full one, and in the lanes where numbers grow by too much in that order, by rows that
// change places (elimination.hpp).
#pragma once

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
  // Of the numbers that are added up for an entry, against the largest entry of its row: as many digits are lost.
  static constexpr double most_growth = 1e4;

 public:
  // Without an order, of a full matrix (n, n). The order must outlive the system. In an order, it is solved in the first
  // `parts` of the packs.
  LinearSystem(int n, const EliminationOrder* order, int parts = PartsOf<T>::count) : n_(n), parts_(parts), order_(order) {
    if (!order_) {
      full_.emplace(n);
      return;
    }
    numbers_.resize(order_->numbers);
  }

  // Where an entry of the matrix is among its places, those of an order if there is one.
  int place(int i, int k) const { return order_ ? order_->number(i, k) : i * n_ + k; }
  int places() const { return order_ ? order_->numbers : n_ * n_; }

  // Of the matrix that has entry(part, place) at a place.
  FISHERPOINT_HOT void factorise(auto&& entry) {
    if (!order_) {
      for (int place = 0; place < places(); ++place)
        for_each_part(PartsOf<T>::count, [&](Part part) { part.set(full_->entries()[place], entry(part, place)); });
      return full_->factorise();
    }
    for (int place = 0; place < places(); ++place)
      for_each_part(parts_, [&](Part part) { part.set(numbers_[place], entry(part, place)); });
    weak_ = lanes_of<P>::none();
    find_largest();
    for (const auto& pivot : order_->pivots) eliminate(pivot);
    any_weak_ = any(weak_);
    if (any_weak_) fall_back(entry);
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
  FISHERPOINT_HOT void solve(T* b) const {
    if (!order_) return full_->solve(b);
    if (any_weak_) {
      of_weak_.assign(b, b + n_);
      full_->solve(of_weak_.data());
    }
    solve_in_order(b);
    for (int i = 0; any_weak_ && i < n_; ++i) b[i] = detail::chosen(weak_, of_weak_[i], b[i]);
  }

 private:
  void solve_in_order(T* b) const {
    for (const auto& pivot : order_->pivots) {
      const int m = static_cast<int>(pivot.rows.size());
      const T* const column = &numbers_[pivot.first] + 1 + m;
      for_each_part_apart<P>(parts_, [&](Part part) {
        const auto known = part(b[pivot.row]);
        for (int i = 0; i < m; ++i) {
          T& other = b[pivot.rows[i]];
          part.set(other, detail::less_product(part(other), part(column[i]), known));
        }
      });
    }
    for (auto pivot = order_->pivots.rbegin(); pivot != order_->pivots.rend(); ++pivot) {
      const int m = static_cast<int>(pivot->rows.size());
      const T* const row = &numbers_[pivot->first];
      for_each_part_apart<P>(parts_, [&](Part part) {
        auto sum = part(b[pivot->row]);
        for (int i = 0; i < m; ++i) sum = detail::less_product(sum, part(row[1 + i]), part(b[pivot->rows[i]]));
        part.set(b[pivot->row], detail::product(sum, part(row[0])));
      });
    }
  }

  // The largest entry of every row, by places in the order.
  void find_largest() {
    largest_.resize(n_);
    for (int k = 0; k < n_; ++k)
      for_each_part_apart<P>(
          parts_, [&](Part part) { part.set(largest_[k], detail::magnitude(part(numbers_[order_->pivots[k].first]))); });
    for (int k = 0; k < n_; ++k) {
      const auto& pivot = order_->pivots[k];
      const int m = static_cast<int>(pivot.behind.size());
      const T* const entry = &numbers_[pivot.first] + 1;
      for (int i = 0; i < m; ++i) {
        P &own = largest_[k], &of_other = largest_[pivot.behind[i]];
        for_each_part_apart<P>(parts_, [&](Part part) {
          part.set(own, max(part(own), detail::magnitude(part(entry[i]))));
          part.set(of_other, max(part(of_other), detail::magnitude(part(entry[m + i]))));
        });
      }
    }
  }

  void eliminate(const EliminationOrder::Pivot& pivot) {
    using Real = PartOf<P>;
    const int m = static_cast<int>(pivot.behind.size());
    T* const diagonal = &numbers_[pivot.first];
    T *const row = diagonal + 1, *const column = row + m;
    for_each_part_apart<P>(parts_, [&](Part part) {
      Real in_row = detail::magnitude(part(*diagonal));
      auto weak = part(weak_) | ((in_row <= Real(0.0)) & (in_row >= Real(0.0)));
      for (int i = 0; i < m; ++i) in_row = max(in_row, detail::magnitude(part(row[i])));
      const auto inverse = detail::fused_reciprocal(part(*diagonal));
      part.set(*diagonal, inverse);
      for (int i = 0; i < m; ++i) {
        const auto factor = detail::product(part(column[i]), inverse);
        part.set(column[i], factor);
        weak = weak | (detail::magnitude(factor) * in_row > most_growth * part(largest_[pivot.behind[i]]));
      }
      part.set(weak_, weak);
    });
    const int* target = pivot.targets.data();
    for (int i = 0; i < m; ++i)
      for (int k = 0; k < m; ++k, ++target) {
        T& entry = numbers_[*target];
        for_each_part_apart<P>(
            parts_, [&](Part part) { part.set(entry, detail::less_product(part(entry), part(column[i]), part(row[k]))); });
      }
  }

  [[gnu::cold, gnu::noinline]] void fall_back(auto&& entry) {
    if (!full_) full_.emplace(n_);
    full_->clear();
    const auto put = [&](int i, int k, int place) {
      for_each_part(parts_, [&](Part part) { part.set((*full_)(i, k), entry(part, place)); });
    };
    for (const auto& pivot : order_->pivots) {
      const int m = static_cast<int>(pivot.behind.size());
      put(pivot.row, pivot.row, pivot.first);
      for (int k = 0; k < m; ++k) {
        const int other = pivot.rows[k];
        put(pivot.row, other, pivot.first + 1 + k);
        put(other, pivot.row, pivot.first + 1 + m + k);
      }
    }
    full_->factorise();
  }

  int n_;
  int parts_;
  const EliminationOrder* order_;
  std::optional<Elimination<T>> full_;
  ShelfVector<T> numbers_;  // L and U, with the reciprocals of U's diagonal
  ShelfVector<P> largest_;
  mutable ShelfVector<T> of_weak_;
  Mask weak_ = lanes_of<P>::none();
  bool any_weak_ = false;
};

}  // namespace fisherpoint
