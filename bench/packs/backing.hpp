// One kind of vector, chosen by a macro, behind what `StateEquation` and `Replay` ask of a number: a thin struct for each.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <utility>

#include "fisherpoint/numbers/pack.hpp"
#if defined(BACKING_eigen)
#include <Eigen/Core>
#elif defined(BACKING_simd)
#include <experimental/simd>
#elif defined(BACKING_xsimd)
#include <xsimd/xsimd.hpp>
#endif

#if defined(BACKING_ours)

using Number = fisherpoint::Pack<WIDTH>;

#else

namespace backing {

#if defined(BACKING_eigen)

using V = Eigen::Array<double, WIDTH, 1>;
using B = Eigen::Array<bool, WIDTH, 1>;
inline V all(double s) { return V::Constant(s); }
inline V load(const double* from) { return V::Map(from); }
inline void store(const V& a, double* to) { V::Map(to) = a; }
inline V root(const V& a) { return a.sqrt(); }
inline V magnitude(const V& a) { return a.abs(); }
inline V choose(const B& m, const V& a, const V& b) { return m.select(a, b); }
inline B both(const B& a, const B& b) { return a && b; }

#elif defined(BACKING_simd)

namespace stdx = std::experimental;
using V = std::conditional_t<WIDTH == stdx::native_simd<double>::size(), stdx::native_simd<double>,
                             stdx::fixed_size_simd<double, WIDTH> >;
using B = V::mask_type;
inline V all(double s) { return V(s); }
inline V load(const double* from) { return V(from, stdx::element_aligned); }
inline void store(const V& a, double* to) { a.copy_to(to, stdx::element_aligned); }
inline V root(const V& a) { return stdx::sqrt(a); }
inline V magnitude(const V& a) { return stdx::abs(a); }
inline V choose(const B& m, const V& a, V b) {
  stdx::where(m, b) = a;
  return b;
}

#elif defined(BACKING_xsimd)

using V = xsimd::batch<double>;
using B = V::batch_bool_type;
static_assert(V::size == WIDTH);
inline V all(double s) { return V(s); }
inline V load(const double* from) { return V::load_unaligned(from); }
inline void store(const V& a, double* to) { a.store_unaligned(to); }
inline V root(const V& a) { return xsimd::sqrt(a); }
inline V magnitude(const V& a) { return xsimd::abs(a); }
inline V choose(const B& m, const V& a, const V& b) { return xsimd::select(m, a, b); }

#elif defined(BACKING_vector)  // a single one of the compiler's, however wide, with the machine's own roots and quotients

typedef double V __attribute__((vector_size(8 * WIDTH)));
typedef std::int64_t B __attribute__((vector_size(8 * WIDTH)));
inline V all(double s) { return s - V{}; }
inline V load(const double* from) {
  V a;
  std::memcpy(&a, from, sizeof a);
  return a;
}
inline void store(const V& a, double* to) { std::memcpy(to, &a, sizeof a); }
inline V root(V a) {
  fisherpoint::NativeVector part[WIDTH / fisherpoint::native_lanes];
  std::memcpy(part, &a, sizeof a);
#if defined(__AVX512F__)
  for (auto& p : part) p = _mm512_sqrt_pd(p);
#else
  for (auto& p : part) p = fisherpoint::native_sqrt(p);
#endif
  std::memcpy(&a, part, sizeof a);
  return a;
}
inline V magnitude(V a) { return (V)((B)a & INT64_MAX); }
inline V choose(B m, V a, V b) { return m ? a : b; }

#endif

#if !defined(BACKING_eigen)
inline B both(const B& a, const B& b) { return a & b; }
#endif

struct Bools {
  B b;
  friend Bools operator&(const Bools& a, const Bools& b) { return {both(a.b, b.b)}; }
};

struct Lanes {
  static constexpr int width = WIDTH;
  V v;

  Lanes() = default;
  Lanes(double s) : v(backing::all(s)) {}
  static Lanes of(const V& v) {
    Lanes r;
    r.v = v;
    return r;
  }
  static Lanes load(const double* from) { return of(backing::load(from)); }
  void store(double* to) const { backing::store(v, to); }

  friend Lanes operator+(const Lanes& a, const Lanes& b) { return of(a.v + b.v); }
  friend Lanes operator-(const Lanes& a, const Lanes& b) { return of(a.v - b.v); }
  friend Lanes operator*(const Lanes& a, const Lanes& b) { return of(a.v * b.v); }
  friend Lanes operator/(const Lanes& a, const Lanes& b) { return of(a.v / b.v); }
  friend Lanes operator-(const Lanes& a) { return of(-a.v); }
  Lanes& operator+=(const Lanes& b) { return *this = *this + b; }
  Lanes& operator-=(const Lanes& b) { return *this = *this - b; }
  Lanes& operator*=(const Lanes& b) { return *this = *this * b; }
  friend Bools operator<(const Lanes& a, const Lanes& b) { return {a.v < b.v}; }
  friend Bools operator>(const Lanes& a, const Lanes& b) { return {a.v > b.v}; }
  friend Lanes select(const Bools& m, const Lanes& a, const Lanes& b) { return of(choose(m.b, a.v, b.v)); }
  friend Lanes min(const Lanes& a, const Lanes& b) { return select(a < b, a, b); }
  friend Lanes sqrt(const Lanes& a) { return of(root(a.v)); }
  friend Lanes abs(const Lanes& a) { return of(magnitude(a.v)); }
  friend std::pair<Lanes, Lanes> root_and_slope(const Lanes& a) { return {sqrt(a), 0.5 / sqrt(a)}; }
};

}  // namespace backing

using Number = backing::Lanes;

template <>
struct fisherpoint::lanes_of<Number> {
  using mask = backing::Bools;
  static constexpr int width = WIDTH;
};

#endif
