// Elementary functions of numbers of every kind: plain ones, packs (lane by lane) and duals. Square roots, and absolute values
// and extremes of what is no dual, are in pack.hpp and dual.hpp.
#pragma once

#include <cmath>

#include "fisherpoint/numbers/dual.hpp"
#include "fisherpoint/numbers/elementary.hpp"
#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

template <class P>
P each_lane(const P& a, double (*function)(double)) {
  P r;
  for (int lane = 0; lane < lanes_of<P>::width; ++lane) lanes_of<P>::set(r, lane, function(lanes_of<P>::get(a, lane)));
  return r;
}

template <class P>
concept NoDual = variables_of<P> == 0 && requires(const P& a) { value_of(a) > P(0.0); };

// Of a plain number what a vector of it has in its lanes, so that both are the same bits.
template <class P>
P each_part(const P& a, NativeVector (*function)(NativeVector)) {
  if constexpr (std::same_as<P, double>) {
    return function(in_all(a))[0];
  } else {
    P r;
    for (int k = 0; k < P::parts; ++k) r.part[k] = function(a.part[k]);
    return r;
  }
}

#define FISHERPOINT_WHOLE(name)            \
  template <NoDual P>                      \
  P name(const P& a) {                     \
    return each_part(a, elementary::name); \
  }
FISHERPOINT_WHOLE(exp)
FISHERPOINT_WHOLE(log)
FISHERPOINT_WHOLE(sin)
FISHERPOINT_WHOLE(cos)
FISHERPOINT_WHOLE(tan)
FISHERPOINT_WHOLE(sinh)
FISHERPOINT_WHOLE(cosh)
FISHERPOINT_WHOLE(tanh)
#undef FISHERPOINT_WHOLE

#define FISHERPOINT_EACH_LANE(name)                             \
  template <NoDual P>                                           \
  P name(const P& a) {                                          \
    return each_lane(a, [](double x) { return std::name(x); }); \
  }
FISHERPOINT_EACH_LANE(asin)
FISHERPOINT_EACH_LANE(acos)
FISHERPOINT_EACH_LANE(atan)
#undef FISHERPOINT_EACH_LANE

template <NoDual P>
P power(const P& a, const P& b) {
  P r;
  for (int lane = 0; lane < lanes_of<P>::width; ++lane)
    lanes_of<P>::set(r, lane, std::pow(lanes_of<P>::get(a, lane), lanes_of<P>::get(b, lane)));
  return r;
}

// -1, 0 or 1; no derivative.
auto sign(const auto& a) {
  const auto& value = value_of(a);
  using P = std::remove_cvref_t<decltype(value)>;
  return select(value > P(0.0), P(1.0), select(value < P(0.0), P(-1.0), value));
}

// b where a > 0, else c; what is not taken may be NaN.
template <class A, class B, class C>
auto choose(const A& a, const B& b, const C& c) {
  const auto& value = value_of(a);
  using P = std::remove_cvref_t<decltype(value)>;
  constexpr Variables both = variables_of<B> | variables_of<C>;
  const auto first = value > P(0.0);
  const P chosen = select(first, P(value_of(b)), P(value_of(c)));
  if constexpr (both == 0) {
    return chosen;
  } else {
    Dual<P, both> r;
    r.value = chosen;
    for_each_variable<both>(
        [&](auto k) { r.slopes[Dual<P, both>::template position<k>] = select(first, slope_of<k, P>(b), slope_of<k, P>(c)); });
    return r;
  }
}

// Of duals, by the chain rule. Each has its derivative from its value where it can.
template <class T, Variables A>
auto exp(const Dual<T, A>& a) {
  const T value = exp(a.value);
  return chain(value, value, a);
}
template <class T, Variables A>
auto log(const Dual<T, A>& a) {
  return chain(log(a.value), T(1.0 / a.value), a);
}
template <class T, Variables A>
auto sin(const Dual<T, A>& a) {
  return chain(sin(a.value), cos(a.value), a);
}
template <class T, Variables A>
auto cos(const Dual<T, A>& a) {
  return chain(cos(a.value), T(-sin(a.value)), a);
}
template <class T, Variables A>
auto tan(const Dual<T, A>& a) {
  const T value = tan(a.value);
  return chain(value, T(1.0 + value * value), a);
}
template <class T, Variables A>
auto asin(const Dual<T, A>& a) {
  return chain(asin(a.value), T(1.0 / sqrt(T(1.0 - a.value * a.value))), a);
}
template <class T, Variables A>
auto acos(const Dual<T, A>& a) {
  return chain(acos(a.value), T(-1.0 / sqrt(T(1.0 - a.value * a.value))), a);
}
template <class T, Variables A>
auto atan(const Dual<T, A>& a) {
  return chain(atan(a.value), T(1.0 / (1.0 + a.value * a.value)), a);
}
template <class T, Variables A>
auto sinh(const Dual<T, A>& a) {
  return chain(sinh(a.value), cosh(a.value), a);
}
template <class T, Variables A>
auto cosh(const Dual<T, A>& a) {
  return chain(cosh(a.value), sinh(a.value), a);
}
template <class T, Variables A>
auto tanh(const Dual<T, A>& a) {
  const T value = tanh(a.value);
  return chain(value, T(1.0 - value * value), a);
}
// The base's derivative is right for negative bases and integer exponents; the exponent's asks for a positive base.
template <class T, Variables A>
auto power(const Dual<T, A>& a, const T& b) {
  return chain(power(a.value, b), T(b * power(a.value, T(b - 1.0))), a);
}
template <class T, Variables A>
  requires(!std::same_as<T, double>)
auto power(const Dual<T, A>& a, double b) {
  return power(a, T(b));
}
template <class T, Variables B>
auto power(const T& a, const Dual<T, B>& b) {
  const T value = power(a, b.value);
  return chain(value, T(value * log(a)), b);
}
template <class T, Variables A, Variables B>
auto power(const Dual<T, A>& a, const Dual<T, B>& b) {
  const T value = power(a.value, b.value), base = b.value * power(a.value, T(b.value - 1.0)), exponent = value * log(a.value);
  return chain<T>(value, a, [&](const T& s) { return base * s; }, b, [&](const T& s) { return exponent * s; });
}
template <class T, Variables A>
auto abs(const Dual<T, A>& a) {
  return chain(abs(a.value), sign(a.value), a);
}

// Of two numbers of which at least one is a dual.
template <class A, class B>
  requires(variables_of<A> != 0 || variables_of<B> != 0)
auto min(const A& a, const B& b) {
  return choose(b - a, a, b);
}
template <class A, class B>
  requires(variables_of<A> != 0 || variables_of<B> != 0)
auto max(const A& a, const B& b) {
  return choose(a - b, a, b);
}

}  // namespace fisherpoint
