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

  // Of the matrix that has entry(place)(part) at a place.
  FISHERPOINT_HOT void factorise(auto&& entry) {
    if (!order_) {
      for (int place = 0; place < places(); ++place) {
        const auto of_parts = entry(place);
        for_each_part(PartsOf<T>::count, [&](Part part) { part.set(full_->entries()[place], of_parts(part)); });
      }
      return full_->factorise();
    }
    weak_ = lanes_of<P>::none();
    largest_.assign(n_, P(0.0));
    on_parts([&](auto parts) {
      int filled = 0;
      for (const auto& pivot : order_->pivots) {
        // Up to what it changes, and no further: that is still in a cache then.
        for (const int end = order_->end_of(pivot); filled < end; ++filled) fill(parts, order_->pivots[filled], filled, entry);
        eliminate(parts, pivot);
      }
    });
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
    on_parts([&](auto parts) { solve_in_order(parts, b); });
    for (int i = 0; any_weak_ && i < n_; ++i) b[i] = detail::chosen(weak_, of_weak_[i], b[i]);
  }

 private:
  static constexpr int most_parts = PartsOf<T>::count;
  using Real = PartOf<P>;

  // work(parts) with how many are in use, which is known to the compiler where it is all of them.
  void on_parts(auto&& work) const { parts_ == most_parts ? work(Count<most_parts>{}) : work(parts_); }

  void solve_in_order(auto parts, T* b) const {
    const int* const rows = order_->rows.data();
    T known;
    for (const auto& pivot : order_->pivots) {
      const T* const column = &numbers_[pivot.first] + 1 + pivot.others;
      for_each_part(parts, [&](Part part) { part.set(known, part(b[pivot.row])); });
      for (int i = 0; i < pivot.others; ++i) {
        T& other = b[rows[pivot.at + i]];
        for_each_part(parts,
                      [&](Part part) { part.set(other, detail::less_product(part(other), part(column[i]), part(known))); });
      }
    }
    for (auto pivot = order_->pivots.rbegin(); pivot != order_->pivots.rend(); ++pivot) {
      const T* const row = &numbers_[pivot->first];
      for_each_part(parts, [&](Part part) { part.set(known, part(b[pivot->row])); });
      for (int i = 0; i < pivot->others; ++i) {
        const T& other = b[rows[pivot->at + i]];
        for_each_part(parts,
                      [&](Part part) { part.set(known, detail::less_product(part(known), part(row[1 + i]), part(other))); });
      }
      for_each_part(parts, [&](Part part) { part.set(b[pivot->row], detail::product(part(known), part(row[0]))); });
    }
  }

  // What a pivot, at this place, has of the matrix; and the largest entry of every row, by places in the order.
  void fill(auto parts, const EliminationOrder::Pivot& pivot, int at, auto&& entry) {
    const auto put = [&](int place, int row) {
      const auto of_parts = entry(place);
      for_each_part(parts, [&](Part part) {
        const PartOf<T> value = of_parts(part);
        part.set(numbers_[place], value);
        part.set(largest_[row], max(part(largest_[row]), detail::magnitude(value)));
      });
    };
    const int row = pivot.first + 1, column = row + pivot.others;
    put(pivot.first, at);
    for (int i = 0; i < pivot.others; ++i) put(row + i, at);
    for (int i = 0; i < pivot.others; ++i) put(column + i, order_->behind[pivot.at + i]);
  }

  void eliminate(auto parts, const EliminationOrder::Pivot& pivot) {
    const int m = pivot.others;
    T* const diagonal = &numbers_[pivot.first];
    T *const row = diagonal + 1, *const column = row + m;
    const int* const behind = order_->behind.data() + pivot.at;
    for_each_part(parts, [&](Part part) {
      Real in_row = detail::magnitude(part(*diagonal));
      auto weak = part(weak_) | ((in_row <= Real(0.0)) & (in_row >= Real(0.0)));
      for (int i = 0; i < m; ++i) in_row = max(in_row, detail::magnitude(part(row[i])));
      const auto inverse = detail::fused_reciprocal(part(*diagonal));
      part.set(*diagonal, inverse);
      for (int i = 0; i < m; ++i) {
        const auto factor = detail::product(part(column[i]), inverse);
        part.set(column[i], factor);
        weak = weak | (detail::magnitude(factor) * in_row > most_growth * part(largest_[behind[i]]));
      }
      part.set(weak_, weak);
    });
    const int* target = order_->targets.data() + pivot.target;
    for (int i = 0; i < m; ++i)
      for (int k = 0; k < m; ++k, ++target) {
        T& number = numbers_[*target];
        for_each_part(parts,
                      [&](Part part) { part.set(number, detail::less_product(part(number), part(column[i]), part(row[k]))); });
      }
  }

  [[gnu::cold, gnu::noinline]] void fall_back(auto&& entry) {
    if (!full_) full_.emplace(n_);
    full_->clear();
    const auto put = [&](int i, int k, int place) {
      const auto of_parts = entry(place);
      for_each_part(parts_, [&](Part part) { part.set((*full_)(i, k), of_parts(part)); });
    };
    for (const auto& pivot : order_->pivots) {
      put(pivot.row, pivot.row, pivot.first);
      for (int k = 0; k < pivot.others; ++k) {
        const int other = order_->rows[pivot.at + k];
        put(pivot.row, other, pivot.first + 1 + k);
        put(other, pivot.row, pivot.first + 1 + pivot.others + k);
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
