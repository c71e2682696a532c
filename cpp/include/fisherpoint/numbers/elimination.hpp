// Systems of linear equations, A x = b with a dense A, by Gaussian elimination in every lane: rows change places where a lane
// needs it, and there alone. What is singular gives infinities or NaN.
#pragma once

#include <algorithm>

#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/parts.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

template <class P>
struct Complex {
  P re, im;

  friend Complex operator-(const Complex& a, const Complex& b) { return {a.re - b.re, a.im - b.im}; }
  friend Complex operator*(const Complex& a, const Complex& b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  }
};

template <class P>
struct PartsOf<Complex<P>> {
  using type = Complex<PartOf<P>>;
  static constexpr int count = PartsOf<P>::count;
  static type get(const Complex<P>& from, int k) { return {PartsOf<P>::get(from.re, k), PartsOf<P>::get(from.im, k)}; }
  static void set(Complex<P>& to, int k, const type& value) {
    PartsOf<P>::set(to.re, k, value.re);
    PartsOf<P>::set(to.im, k, value.im);
  }
};

namespace detail {

template <class T>
T zero() {
  if constexpr (requires(T t) { t.im; })
    return {decltype(T::re)(0.0), decltype(T::im)(0.0)};
  else
    return T(0.0);
}
template <class Mask, class P>
P chosen(const Mask& lanes, const P& a, const P& b) {
  return select(lanes, a, b);
}
template <class Mask, class P>
Complex<P> chosen(const Mask& lanes, const Complex<P>& a, const Complex<P>& b) {
  return {select(lanes, a.re, b.re), select(lanes, a.im, b.im)};
}

template <class P>
struct NumberOf {
  using type = P;
};
template <class P>
struct NumberOf<Complex<P>> {
  using type = P;
};

// a - b c.
template <class P>
[[gnu::always_inline]] inline P less_product(const P& a, const P& b, const P& c) {
  return fused(-b, c, a);
}
template <class P>
[[gnu::always_inline]] inline Complex<P> less_product(const Complex<P>& a, const Complex<P>& b, const Complex<P>& c) {
  return {fused(-b.re, c.re, fused(b.im, c.im, a.re)), fused(-b.re, c.im, fused(-b.im, c.re, a.im))};
}
template <class P>
[[gnu::always_inline]] inline P product(const P& a, const P& b) {
  return a * b;
}
template <class P>
[[gnu::always_inline]] inline Complex<P> product(const Complex<P>& a, const Complex<P>& b) {
  return {fused(a.re, b.re, -(a.im * b.im)), fused(a.re, b.im, a.im * b.re)};
}

template <class P>
P magnitude(const P& a) {
  return abs(a);
}
template <class P>
P magnitude(const Complex<P>& a) {
  return abs(a.re) + abs(a.im);
}
template <class P>
P reciprocal(const P& a) {
  return 1.0 / a;
}
template <class P>
Complex<P> reciprocal(const Complex<P>& a) {
  const P part = 1.0 / (a.re * a.re + a.im * a.im);
  return {a.re * part, -(a.im * part)};
}
// The same, where a product and a sum are to be fused in whatever the call stands.
template <class P>
[[gnu::always_inline]] inline P fused_reciprocal(const P& a) {
  return 1.0 / a;
}
template <class P>
[[gnu::always_inline]] inline Complex<P> fused_reciprocal(const Complex<P>& a) {
  const P part = 1.0 / fused(a.re, a.re, a.im * a.im);
  return {a.re * part, -(a.im * part)};
}
template <class Mask, class P>
void exchange_where(const Mask& lanes, P& a, P& b) {
  const P kept = a;
  a = select(lanes, b, a);
  b = select(lanes, kept, b);
}
template <class Mask, class P>
void exchange_where(const Mask& lanes, Complex<P>& a, Complex<P>& b) {
  exchange_where(lanes, a.re, b.re);
  exchange_where(lanes, a.im, b.im);
}

}  // namespace detail

// T: a pack, or a complex number of packs.
template <class T>
class Elimination {
  using P = typename detail::NumberOf<T>::type;
  using Mask = mask_of_lanes<P>;
  // A diagonal entry of at least this share of the largest below it stays where it is.
  static constexpr double large_enough = 0.1;

 public:
  explicit Elimination(int n) : n_(n), a_(n * n), place_(n) {}

  T& operator()(int i, int k) { return a_[i * n_ + k]; }
  void clear() { std::fill(a_.begin(), a_.end(), detail::zero<T>()); }
  T* entries() { return a_.data(); }  // row by row

  // Of the matrix as its entries are; they are lost.
  [[gnu::noinline]] void factorise() {
    for (int k = 0; k < n_; ++k) {
      bring_up(k);
      T* const top = &a_[k * n_];
      const T inverse = top[k] = detail::reciprocal(top[k]);
      for (int i = k + 1; i < n_; ++i) {
        T* const row = &a_[i * n_];
        const T factor = row[k] = row[k] * inverse;
        for (int m = k + 1; m < n_; ++m) row[m] = row[m] - factor * top[m];
      }
    }
  }

  // Of a real matrix that is factorised, the sign of its first k + 1 pivots' product, turned where rows were exchanged; for the
  // last k that of the determinant.
  void signs(P* out) const {
    P sign(1.0);
    for (int k = 0; k < n_; ++k) {
      sign = select(a_[k * n_ + k] < P(0.0), -sign, sign);
      if (place_[k].moved) sign = select(place_[k].row > P(k), -sign, sign);
      out[k] = sign;
    }
  }

  // b becomes x.
  [[gnu::noinline]] void solve(T* b) const {
    for (int k = 0; k < n_; ++k)
      for (int i = k + 1; place_[k].moved && i < n_; ++i) detail::exchange_where(is_row(k, i), b[k], b[i]);
    for (int i = 1; i < n_; ++i)
      for (int k = 0; k < i; ++k) b[i] = b[i] - a_[i * n_ + k] * b[k];
    for (int k = n_; k-- > 0;) {
      for (int m = k + 1; m < n_; ++m) b[k] = b[k] - a_[k * n_ + m] * b[m];
      b[k] = b[k] * a_[k * n_ + k];
    }
  }

 private:
  struct Place {
    P row{0.0};  // which row was brought up here, in every lane
    bool moved = false;
  };

  Mask is_row(int k, int i) const { return abs(place_[k].row - P(i)) < P(0.5); }

  void bring_up(int k) {
    Place& place = place_[k];
    const P own = detail::magnitude(a_[k * n_ + k]);
    P largest = own;
    place = {P(k), false};
    for (int i = k + 1; i < n_; ++i) {
      const P size = detail::magnitude(a_[i * n_ + k]);
      const Mask larger = (size > largest) & (large_enough * size > own);
      largest = select(larger, size, largest);
      place.row = select(larger, P(i), place.row);
    }
    place.moved = any(place.row > P(k));
    if (!place.moved) return;
    for (int i = k + 1; i < n_; ++i) {
      const Mask here = is_row(k, i);
      if (!any(here)) continue;
      for (int m = 0; m < n_; ++m) detail::exchange_where(here, a_[k * n_ + m], a_[i * n_ + m]);
    }
  }

  int n_;
  ShelfVector<T> a_;  // row by row; once factorised, L below the diagonal, and on it the reciprocals of U's
  ShelfVector<Place> place_;
};

}  // namespace fisherpoint
