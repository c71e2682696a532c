// Elementary functions of whole vectors of the instruction set: errors stay below one unit in the last place at every level
// (0.8 of one, but for tan, and for sin and cos without fused multiply-adds) wherever the result is a normal number. A lane's
// result does not depend on the other lanes.
//
// The argument is reduced to a short interval, on which a polynomial is summed; what roundings the reduction and the last sums
// would leave is carried along as a second number. Products of numbers that are cut to 26 bits are exact, by which remainders
// are found on levels without fused multiply-adds too. A product that is added stands in `fused`, unless it is exact, so that
// the result is the same however a compiler contracts. Coefficients and parts of constants:
// cpp/scripts/elementary_coefficients.py.
#pragma once

#include <cmath>
#include <cstdint>

#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint::elementary {

using V = NativeVector;
using Bits = NativeMask;

// The unevaluated sum of a number and of a much smaller one.
struct Pair {
  V high, low;
};

namespace detail {

constexpr double log_2[] = {0x1.62e42fefa3800p-1, 0x1.ef35793c76730p-45};
constexpr double half_pi[] = {0x1.921fb54440000p+0, 0x1.68c234c4c0000p-39, 0x1.98a2e03700000p-77, 0x1.cd129024e088ap-115};
constexpr double exp_q[] = {0x1.5555555555559p-3,  0x1.5555555555549p-5,  0x1.111111110f7ecp-7,  0x1.6c16c16c1cce4p-10,
                            0x1.a01a01af75923p-13, 0x1.a01a018305f36p-16, 0x1.71ddf953ed86fp-19, 0x1.27e52b2c8593dp-22,
                            0x1.af5d2030794c3p-26, 0x1.1ef5233005dddp-29};
constexpr double log_p[] = {0x1.5555555555592p-1, 0x1.999999997fdb7p-2, 0x1.24924941f12d0p-2, 0x1.c71c520955d5bp-3,
                            0x1.74663eea0c7c9p-3, 0x1.39a1ba8a7b0c9p-3, 0x1.2f056565d873ep-3};
constexpr double sin_s[] = {-0x1.5555555555555p-3,  0x1.111111111110bp-7,  -0x1.a01a01a018a6cp-13, 0x1.71de3a533079ap-19,
                            -0x1.ae64528d66b2bp-26, 0x1.61208c3877989p-33, -0x1.aaa23f5bd836bp-41};
constexpr double cos_c[] = {0x1.555555555554bp-5,   -0x1.6c16c16c14f90p-10, 0x1.a01a019c84325p-16,
                            -0x1.27e4f7eaaf33fp-22, 0x1.1ee9d7a5e3caap-29,  -0x1.8fa492154d524p-37};

constexpr double whole = 0x1.8p52;  // what is added to it is rounded to a whole number, which then stands in the last bits
constexpr double tiny = 0x1p-27;    // of smaller numbers odd functions are these numbers
constexpr double most = 710.5;      // where sinh and cosh are infinite
constexpr double far_out = 1e5;     // of larger numbers the parts of pi / 2 would not do

// The sum of c[k] x^k, even and odd powers side by side.
template <int n>
V polynomial(V x, const double (&c)[n]) {
  const V z = x * x;
  V one = in_all(c[n - 1]), other = in_all(c[n - 2]);
  for (int k = n - 3; k >= 0; k -= 2) {
    one = fused(one, z, in_all(c[k]));
    if (k > 0) other = fused(other, z, in_all(c[k - 1]));
  }
  return n % 2 ? fused(other, x, one) : fused(one, x, other);
}

inline V cut(V a) { return (V)((Bits)a & ~((std::int64_t{1} << 27) - 1)); }
inline V size_of(V a) { return (V)((Bits)a & INT64_MAX); }
inline V with_sign(V size, V sign) { return (V)((Bits)size | ((Bits)sign & INT64_MIN)); }
// 2^n of a whole number n.
inline V power_of_two(V n) { return (V)((Bits)(n + (whole + 1023.0)) << 52); }

// |a| >= |b|.
inline Pair sum(V a, V b) {
  const V high = a + b;
  return {high, (a - high) + b};
}
inline Pair sum_in_any_order(V a, V b) {
  const V high = a + b, other = high - a;
  return {high, (a - (high - other)) + (b - other)};
}

inline Pair quotient(Pair a, Pair b) {
  const V inverse = in_all(1.0) / b.high, high = cut(a.high * inverse), b_cut = cut(b.high);
  const V remainder = fused(-high, (b.high - b_cut) + b.low, fused(-high, b_cut, a.high)) + a.low;
  return {high, remainder * inverse};
}

// The function that `instead` computes in these lanes.
[[gnu::noinline, gnu::cold]] inline V in_lanes(Bits lanes, V x, V others, double (*instead)(double)) {
  for (int lane = 0; lane < native_lanes; ++lane)
    if (lanes[lane]) others[lane] = instead(x[lane]);
  return others;
}
inline V unless(Bits lanes, V x, V others, double (*instead)(double)) {
  Mask<native_lanes> mask;
  mask.part[0] = lanes;
  return any(mask) ? in_lanes(lanes, x, others, instead) : others;
}

// exp(x) = 2^n exp(r + left), exp(r) = 1 + r + r^2 / 2 + r^3 q.
struct Power {
  V n, r, left, q;
};
inline Power power_of(V x) {
  const V n = fused(x, in_all(0x1.71547652b82fep+0), in_all(whole)) - whole;
  const V rough = fused(-n, in_all(log_2[0]), x), r = fused(-n, in_all(log_2[1]), rough);
  return {n, r, fused(-n, in_all(log_2[1]), rough - r), polynomial(r, exp_q)};
}
// (exp(x) - 1) / 4 for x in [0, 710.5], which is as far as exp(x) / 2 is finite.
inline Pair quarter_of_power_less_one(V x) {
  const auto [n, r, left, q] = power_of(x);
  const V scale = power_of_two(n - 2.0), r_cut = cut(r), exact = 0.5 * (r_cut * r_cut);
  const V rest = fused(0.5 * (r - r_cut), r + r_cut, fused(r * r * r, q, left));
  const Pair less = sum(scale, in_all(-0.25)), first = sum(less.high, scale * r), second = sum(first.high, scale * exact);
  const Pair all = sum(second.high, scale * rest);
  return {all.high, all.low + (second.low + (first.low + less.low))};
}
inline Pair plus(Pair a, double b) {
  const Pair rough = sum_in_any_order(a.high, in_all(b));
  return {rough.high, rough.low + a.low};
}

// sin(x) and cos(x), up to exchange and signs, which `turns` has: how many quarters of a turn were taken off.
struct Circle {
  Bits turns;
  Pair sine, cosine;
};
inline Circle circle(V x) {
  const V shifted = fused(x, in_all(0x1.45f306dc9c883p-1), in_all(whole)), n = shifted - whole;
  const V p1 = in_all(half_pi[1]), p2 = in_all(half_pi[2]);
  const V r0 = fused(-n, in_all(half_pi[0]), x), r1 = fused(-n, p1, r0), r2 = fused(-n, p2, r1);
  const V left = fused(-n, p1, r0 - r1) + fused(-n, p2, r1 - r2), less = fused(n, in_all(half_pi[3]), -left);
  const V r = r2 - less, low = (r2 - r) - less;

  const V z = r * r, slope = fused(z, in_all(-0.5), in_all(1.0));
  const V by_sine = fused(z * r, polynomial(z, sin_s), low * slope);
  // Half of r^2, of which the part of 52 bits is exact.
  const V r_cut = cut(r), exact = 0.5 * (r_cut * r_cut), w = 1.0 - exact;
  V by_cosine = fused(z * z, polynomial(z, cos_c), (1.0 - w) - exact);
  by_cosine = fused(-0.5 * (r - r_cut), r + r_cut, by_cosine);
  return {(Bits)shifted, {r, by_sine}, {w, fused(-r, low, by_cosine)}};
}
inline V turned(const Circle& at, Bits turns) {
  const V size = (turns & 1) != 0 ? at.cosine.high + at.cosine.low : at.sine.high + at.sine.low;
  return (V)((Bits)size ^ ((turns & 2) << 62));
}

}  // namespace detail

// Not inline: a few hundred bytes each, which the kernels have in many places.

[[gnu::noinline]] inline V exp(V x) {
  using namespace detail;
  V within = x < -746.0 ? in_all(-746.0) : x;
  within = within > 710.0 ? in_all(710.0) : within;
  const auto [n, r, left, q] = power_of(within);
  const Pair first = sum(in_all(1.0), r);
  const V rest = fused(r * r, fused(r, q, in_all(0.5)), left);
  const V half = (0.5 * n + whole) - whole;  // in two factors, as the power of two may be no normal number
  return (first.high + (first.low + rest)) * power_of_two(half) * power_of_two(n - half);
}

[[gnu::noinline]] inline V log(V x) {
  using namespace detail;
  typedef std::uint64_t Shifted __attribute__((vector_size(register_bytes)));
  constexpr std::uint64_t one = 0x3ff0000000000000, least = 0x3fe6a09e667f3bcd, digits = 0xfffffffffffff;
  // x = 2^e m with m between the roots of 1/2 and 2. Without signs, as the bits of what is not finite would overflow.
  const Shifted shifted = (Shifted)x + (one - least);
  const V e = (V)((shifted >> 52) | 0x4330000000000000) - (0x1p52 + 1023.0);
  const V m = (V)((shifted & digits) + least), d = m + 1.0;
  const Pair s = quotient({m - 1.0, V{}}, {d, m - (d - 1.0)});
  const V both = s.high + s.low, z = both * both;
  const V tail = fused(e, in_all(log_2[1]), fused(z * both, polynomial(z, log_p), s.low + s.low));
  const Pair first = sum(e * log_2[0], s.high + s.high);
  const Bits odd = ~((x >= 0x1p-1022) & (x <= 0x1.fffffffffffffp1023));
  return unless(odd, x, first.high + (first.low + tail), std::log);
}

[[gnu::noinline]] inline V sin(V x) {
  using namespace detail;
  const Circle at = circle(x);
  const V size = size_of(x), result = size < tiny ? x : turned(at, at.turns);
  return unless(~(size <= far_out), x, result, std::sin);
}

[[gnu::noinline]] inline V cos(V x) {
  using namespace detail;
  const Circle at = circle(x);
  return unless(~(size_of(x) <= far_out), x, turned(at, at.turns + 1), std::cos);
}

[[gnu::noinline]] inline V tan(V x) {
  using namespace detail;
  const Circle at = circle(x);
  const Pair sine = sum(at.sine.high, at.sine.low), cosine = sum(at.cosine.high, at.cosine.low);
  const Bits odd = (at.turns & 1) != 0;
  const Pair a{odd ? -cosine.high : sine.high, odd ? -cosine.low : sine.low};
  const Pair b{odd ? sine.high : cosine.high, odd ? sine.low : cosine.low}, ratio = quotient(a, b);
  const V size = size_of(x), result = size < tiny ? x : ratio.high + ratio.low;
  return unless(~(size <= far_out), x, result, std::tan);
}

// With t = exp(|x|) - 1, sinh |x| = (t + t / (t + 1)) / 2.
[[gnu::noinline]] inline V sinh(V x) {
  using namespace detail;
  const V size = size_of(x);
  const Pair t = quarter_of_power_less_one(size > most ? in_all(most) : size), e = plus(t, 0.25), ratio = quotient(t, e);
  const Pair both = sum(t.high, 0.25 * ratio.high);
  const V near = both.high + (both.low + fused(in_all(0.25), ratio.low, t.low)), result = size > 22.0 ? e.high + e.low : near;
  return size < tiny ? x : with_sign(2.0 * result, x);
}

// cosh |x| = (exp(|x|) + exp(-|x|)) / 2.
[[gnu::noinline]] inline V cosh(V x) {
  using namespace detail;
  const V size = size_of(x);
  const Pair e = plus(quarter_of_power_less_one(size > most ? in_all(most) : size), 0.25);
  const Pair inverse = quotient({in_all(0.0625), V{}}, e), both = sum(e.high, inverse.high);
  return 2.0 * (size > 22.0 ? e.high + e.low : both.high + (both.low + (e.low + inverse.low)));
}

// With t = exp(2 |x|) - 1, tanh |x| = t / (t + 2).
[[gnu::noinline]] inline V tanh(V x) {
  using namespace detail;
  const V size = size_of(x), within = size > 22.0 ? in_all(22.0) : size;
  const Pair t = quarter_of_power_less_one(within + within), ratio = quotient(t, plus(t, 0.5));
  return size < tiny ? x : with_sign(ratio.high + ratio.low, x);
}

}  // namespace fisherpoint::elementary
