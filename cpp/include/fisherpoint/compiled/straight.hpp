// The operations of a tape on single vectors of the instruction set, for what is generated as C++ from its lists: each computes
// what tape_machine.hpp does with that part of a pack, to the last bit. The lists say which products and sums are fused, so the
// compiler must contract none (-ffp-contract=off).
#pragma once

#include "fisherpoint/equations/tape_lanes.hpp"
#include "fisherpoint/models/straight_functions.hpp"
#include "fisherpoint/numbers/elementary.hpp"
#include "fisherpoint/numbers/functions.hpp"

namespace fisherpoint::straight {

using V = NativeVector;
using One = Pack<native_lanes>;

inline constexpr int lanes = tape_lanes;

namespace detail {

typedef double InMemory __attribute__((vector_size(register_bytes), may_alias));

inline One pack_of(V a) {
  One r;
  r.part[0] = a;
  return r;
}

}  // namespace detail

// The k-th pack behind `from`, of which this vector is a part.
inline V load(const double* from, int k) { return *reinterpret_cast<const detail::InMemory*>(from + k * lanes); }
inline void store(double* to, int k, V a) { *reinterpret_cast<detail::InMemory*>(to + k * lanes) = a; }
inline V all(const double& a) { return in_all(a); }

inline V add(V a, V b) { return a + b; }
inline V sub(V a, V b) { return a - b; }
inline V mul(V a, V b) { return a * b; }
inline V div(V a, V b) { return native_quotient(a, b); }
inline V neg(V a) { return -a; }
inline V mul_add(V a, V b, V c) { return fused(a, b, c); }
inline V mul_sub(V a, V b, V c) { return fused(a, b, -c); }
inline V sub_mul(V a, V b, V c) { return fused(-a, b, c); }
inline V sqrt(V a) { return native_sqrt(a); }
inline V abs(V a) { return abs(detail::pack_of(a)).part[0]; }
inline V sign(V a) { return fisherpoint::sign(detail::pack_of(a)).part[0]; }
inline V min(V a, V b) { return a < b ? a : b; }
inline V max(V a, V b) { return b < a ? a : b; }
inline V select(V a, V b, V c) { return V{} < a ? b : c; }

using elementary::cos;
using elementary::cosh;
using elementary::exp;
using elementary::log;
using elementary::sin;
using elementary::sinh;
using elementary::tan;
using elementary::tanh;

// Not inline: a program has many of them, and each is long.
[[gnu::noinline]] inline V asin(V a) { return fisherpoint::asin(detail::pack_of(a)).part[0]; }
[[gnu::noinline]] inline V acos(V a) { return fisherpoint::acos(detail::pack_of(a)).part[0]; }
[[gnu::noinline]] inline V atan(V a) { return fisherpoint::atan(detail::pack_of(a)).part[0]; }
[[gnu::noinline]] inline V pow(V a, V b) { return power(detail::pack_of(a), detail::pack_of(b)).part[0]; }

}  // namespace fisherpoint::straight
