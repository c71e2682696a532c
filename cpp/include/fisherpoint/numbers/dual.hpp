// A value with its derivatives, sparse by type: which variables a Dual depends on is part of its type, a bit mask, so
// no zero is ever stored or multiplied and the pattern of a Jacobian is known at compile time.
//
// Forward differentiation by the chain rule,
//     value(a b) = a b,   slope_k(a b) = b slope_k(a) + a slope_k(b),
// where the sum holds only the terms whose bit is set in the operand's mask. Write `auto` for every temporary: the
// type changes from line to line. T is double or a Pack.
//
// Where a model is not smooth it asks on which side of its surface the trajectory runs (model.hpp); no function here branches.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstdint>

#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

using Variables = std::uint64_t;  // bit k set: depends on variable k

template <class T, Variables M>
struct Dual {
  static constexpr Variables mask = M;
  static constexpr int size = std::popcount(M);
  template <int k>
  static constexpr bool depends_on = (M >> k) & 1;
  template <int k>
  static constexpr int position = std::popcount(M & ((Variables{1} << k) - 1));

  T value;
  std::array<T, size> slopes;  // in the order of the set bits

  template <int k>
  const T& slope() const {
    static_assert(depends_on<k>);
    return slopes[position<k>];
  }
};

template <int k, class T>
Dual<T, Variables{1} << k> variable(const T& value) {
  return {value, {T(1.0)}};
}

namespace detail {

template <Variables M, int n>  // the n-th set bit of M
constexpr int nth_bit() {
  Variables rest = M;
  for (int i = 0; i < n; ++i) rest &= rest - 1;
  return std::countr_zero(rest);
}

}  // namespace detail

// f(k) for every variable k in the mask, k an integral_constant.
template <Variables M, class F>
void for_each_variable(F&& f) {
  for_each_index<std::popcount(M)>([&](auto n) { f(std::integral_constant<int, detail::nth_bit<M, n>()>{}); });
}

// d value = p da
template <class T, Variables A>
Dual<T, A> chain(const T& value, const T& p, const Dual<T, A>& a) {
  Dual<T, A> r;
  r.value = value;
  for_each_index<Dual<T, A>::size>([&](auto i) { r.slopes[i] = p * a.slopes[i]; });
  return r;
}

// d value = p(da) + q(db), with p and q functions of a slope, so that a plain sum multiplies nothing
template <class T, Variables A, Variables B, class P, class Q>
Dual<T, (A | B)> chain(const T& value, const Dual<T, A>& a, P&& p, const Dual<T, B>& b, Q&& q) {
  Dual<T, (A | B)> r;
  r.value = value;
  for_each_variable<(A | B)>([&](auto k) {
    constexpr bool in_a = Dual<T, A>::template depends_on<k>, in_b = Dual<T, B>::template depends_on<k>;
    T& slope = r.slopes[Dual<T, (A | B)>::template position<k>];
    if constexpr (in_a && in_b)
      slope = p(a.template slope<k>()) + q(b.template slope<k>());
    else if constexpr (in_a)
      slope = p(a.template slope<k>());
    else
      slope = q(b.template slope<k>());
  });
  return r;
}

template <class T, Variables A, Variables B>
auto operator+(const Dual<T, A>& a, const Dual<T, B>& b) {
  const auto same = [](const T& s) { return s; };
  return chain<T>(a.value + b.value, a, same, b, same);
}
template <class T, Variables A, Variables B>
auto operator-(const Dual<T, A>& a, const Dual<T, B>& b) {
  return chain<T>(a.value - b.value, a, [](const T& s) { return s; }, b, [](const T& s) { return -s; });
}
template <class T, Variables A, Variables B>
auto operator*(const Dual<T, A>& a, const Dual<T, B>& b) {
  return chain<T>(a.value * b.value, a, [&](const T& s) { return b.value * s; }, b, [&](const T& s) { return a.value * s; });
}
template <class T, Variables A, Variables B>
auto operator/(const Dual<T, A>& a, const Dual<T, B>& b) {
  const T inverse = 1.0 / b.value, ratio = a.value * inverse, minus = -(ratio * inverse);
  return chain<T>(ratio, a, [&](const T& s) { return inverse * s; }, b, [&](const T& s) { return minus * s; });
}
template <class T, Variables A>
Dual<T, A> operator-(const Dual<T, A>& a) {
  Dual<T, A> r;
  r.value = -a.value;
  for_each_index<Dual<T, A>::size>([&](auto i) { r.slopes[i] = -a.slopes[i]; });
  return r;
}

// With numbers that carry no derivative.
template <class S, class T>
concept Constant = std::convertible_to<S, T>;

template <class T, Variables A, Constant<T> S>
Dual<T, A> operator+(const Dual<T, A>& a, const S& s) {
  return {T(a.value + s), a.slopes};
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator+(const S& s, const Dual<T, A>& a) {
  return a + s;
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator-(const Dual<T, A>& a, const S& s) {
  return {T(a.value - s), a.slopes};
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator-(const S& s, const Dual<T, A>& a) {
  return s + (-a);
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator*(const Dual<T, A>& a, const S& s) {
  return chain(T(a.value * s), T(s), a);
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator*(const S& s, const Dual<T, A>& a) {
  return a * s;
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator/(const Dual<T, A>& a, const S& s) {
  return a * (1.0 / s);
}
template <class T, Variables A, Constant<T> S>
Dual<T, A> operator/(const S& s, const Dual<T, A>& a) {
  const T inverse = 1.0 / a.value, ratio = s * inverse;
  return chain(ratio, T(-(ratio * inverse)), a);
}

template <class T, Variables A>
Dual<T, A> sqrt(const Dual<T, A>& a) {
  const auto [root, slope] = root_and_slope(a.value);
  return chain(root, slope, a);
}

// Value and variables of anything: a number without derivatives depends on none.
template <class N>
inline constexpr Variables variables_of = 0;
template <class T, Variables M>
inline constexpr Variables variables_of<Dual<T, M>> = M;

template <class T>
const T& value_of(const T& a) {
  return a;
}
template <class T, Variables M>
const T& value_of(const Dual<T, M>& a) {
  return a.value;
}

// Derivative with respect to variable k; zero where the type says so.
template <int k, class T, class N>
T slope_of(const N& a) {
  if constexpr ((variables_of<N> >> k) & 1)
    return a.template slope<k>();
  else
    return T(0.0);
}

}  // namespace fisherpoint
