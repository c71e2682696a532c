// A pack: W numbers that take every operation together, one per lane.
//
// A pack is an array of the widest vectors that the instruction set of this translation unit has. The compiler's own vector
// types carry the arithmetic; only the square root needs an intrinsic. Comparisons give a Mask, and `select` takes the
// place of a branch. Everything a model or the integrator needs of a pack also works on a plain double (with bool for its
// mask), so one source serves both.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>
#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace fisherpoint {

#if defined(__AVX512F__)
inline constexpr int register_bytes = 64;
typedef double NativeVector __attribute__((vector_size(64)));
typedef std::int64_t NativeMask __attribute__((vector_size(64)));
#elif defined(__AVX__)
inline constexpr int register_bytes = 32;
typedef double NativeVector __attribute__((vector_size(32)));
typedef std::int64_t NativeMask __attribute__((vector_size(32)));
#else
inline constexpr int register_bytes = 16;
typedef double NativeVector __attribute__((vector_size(16)));
typedef std::int64_t NativeMask __attribute__((vector_size(16)));
#endif
inline constexpr int native_lanes = register_bytes / sizeof(double);

inline NativeVector in_all(double a) { return a - NativeVector{}; }

// a b + c, rounded once where the level has an instruction for it, as it is wherever the compiler contracts a product and a
// sum.
inline NativeVector fused(NativeVector a, NativeVector b, NativeVector c) {
#if defined(__AVX512F__)
  return _mm512_fmadd_pd(a, b, c);
#elif defined(__AVX__) && defined(__FMA__)
  return _mm256_fmadd_pd(a, b, c);
#elif defined(__aarch64__)
  return (NativeVector)vfmaq_f64((float64x2_t)c, (float64x2_t)a, (float64x2_t)b);
#else
  return a * b + c;
#endif
}
inline double fused(double a, double b, double c) {
#if defined(__FMA__) || defined(__aarch64__)
  return __builtin_fma(a, b, c);
#else
  return a * b + c;
#endif
}

// Square root and quotient, to within one unit in the last place at every level, and of zeros, infinities and NaN what IEEE 754
// says, but for the sign of a zero. AVX-512 machines have one slow divider for both, so there they come from the 14-bit
// estimates of the reciprocals, by one step of Newton's method to 28 bits and one that corrects the result by its remainder,
// and run on the multipliers; where such a step meets 0 times infinity, what it started from is right already. (A divisor below
// 1e-308, of which there is no reciprocal, counts as 0.)
#if defined(__AVX512F__)
// What becomes of a number, by the class of another: four bits for each class, in the order of _mm512_fixupimm_pd.
enum class NumberClass { quiet_nan, signalling_nan, zero, one, minus_infinity, infinity, negative, positive };
enum class Becomes { itself, the_other, infinity = 5, zero = 8 };
constexpr int in_class(NumberClass c, Becomes what) { return static_cast<int>(what) << 4 * static_cast<int>(c); }

template <int table>
NativeVector by_class(NativeVector a, NativeVector other) {
  return _mm512_fixupimm_pd(a, other, _mm512_set1_epi64(table), 0);
}

// `better`, or where that is NaN, a.
inline NativeVector unless_nan(NativeVector a, NativeVector better) {
  using enum NumberClass;
  constexpr auto taken = Becomes::the_other;
  return by_class<(in_class(zero, taken) | in_class(one, taken) | in_class(minus_infinity, taken) | in_class(infinity, taken) |
                   in_class(negative, taken) | in_class(positive, taken))>(a, better);
}

// sqrt(a) and 1 / (2 sqrt(a)), the latter to 28 bits, or NaN for 0 and infinity.
inline std::pair<NativeVector, NativeVector> estimated_root(NativeVector a) {
  using enum NumberClass;
  const NativeVector y = _mm512_maskz_rsqrt14_pd(0xff, a);
  const NativeVector g = a * y, h = 0.5 * y, r = fused(-g, h, in_all(0.5));
  const NativeVector root = fused(g, r, g), half_inverse = fused(h, r, h);
  constexpr int exact = in_class(zero, Becomes::the_other) | in_class(infinity, Becomes::the_other);
  return {by_class<exact>(fused(fused(-root, root, a), half_inverse, root), a), half_inverse};
}
#endif

inline NativeVector native_sqrt(NativeVector a) {
#if defined(__AVX512F__)
  return estimated_root(a).first;
#elif defined(__AVX__)
  return _mm256_sqrt_pd(a);
#elif defined(__x86_64__)
  return _mm_sqrt_pd(a);
#else
  for (int i = 0; i < native_lanes; ++i) a[i] = std::sqrt(a[i]);
  return a;
#endif
}

// sqrt(a) and its derivative 1 / (2 sqrt(a)).
inline std::pair<NativeVector, NativeVector> native_root_and_slope(NativeVector a) {
#if defined(__AVX512F__)
  using enum NumberClass;
  const auto [root, h] = estimated_root(a);
  constexpr int limits = in_class(zero, Becomes::infinity) | in_class(infinity, Becomes::zero);
  return {root, by_class<limits>(fused(h, fused(in_all(-2.0), root * h, in_all(1.0)), h), a)};
#else
  const NativeVector root = native_sqrt(a);
  return {root, 0.5 / root};
#endif
}

inline NativeVector native_quotient(NativeVector a, NativeVector b) {
#if defined(__AVX512F__)
  const NativeVector rough = _mm512_maskz_rcp14_pd(0xff, b);
  const NativeVector y = unless_nan(rough, fused(rough, fused(-b, rough, in_all(1.0)), rough)), q = a * y;
  return unless_nan(q, fused(fused(-b, q, a), y, q));
#else
  return a / b;
#endif
}

// a^(-1/n) to within 1 % for a in [1e-20, 1e12] and n = 10 or 16: all that step control asks of a root. One Newton step on the
// power of two that the exponent's bits give; one tenth is summed from shifts because no baseline vector set divides integers.
template <class V, class Bits, int n>
V rough_inverse_root_of(V a, std::integral_constant<int, n>) {
  static_assert(n == 10 || n == 16);
  const auto bits = std::bit_cast<Bits>(a);
  Bits start;
  if constexpr (n == 16)
    start = std::int64_t{0x43EE3B6000000000} - (bits >> 4);
  else
    start = std::int64_t{0x4653893700000000} -
            ((bits >> 4) + (bits >> 5) + (bits >> 8) + (bits >> 9) + (bits >> 12) + (bits >> 13));
  const auto y = std::bit_cast<V>(start);
  const V y2 = y * y, y4 = y2 * y2, y8 = y4 * y4;
  const V power = n == 16 ? y8 * y8 : y8 * y2;
  return y * ((1.0 + 1.0 / n) - (1.0 / n) * (a * power));
}

template <int W>
struct Mask {
  static constexpr int parts = W / native_lanes;
  NativeMask part[parts];  // per lane: all bits set, or none

  static Mask none() {
    Mask r;
    for (int k = 0; k < parts; ++k) r.part[k] = NativeMask{};
    return r;
  }
  bool operator[](int lane) const { return part[lane / native_lanes][lane % native_lanes] != 0; }
  void set(int lane, bool on) { part[lane / native_lanes][lane % native_lanes] = on ? -1 : 0; }

  friend Mask operator&(Mask a, const Mask& b) {
    for (int k = 0; k < parts; ++k) a.part[k] &= b.part[k];
    return a;
  }
  friend Mask operator|(Mask a, const Mask& b) {
    for (int k = 0; k < parts; ++k) a.part[k] |= b.part[k];
    return a;
  }
  friend Mask operator!(Mask a) {
    for (int k = 0; k < parts; ++k) a.part[k] = ~a.part[k];
    return a;
  }
  friend bool any(const Mask& a) {
    NativeMask folded = a.part[0];
    for (int k = 1; k < parts; ++k) folded |= a.part[k];
#if defined(__AVX512F__)
    return _mm512_test_epi64_mask((__m512i)folded, (__m512i)folded) != 0;
#elif defined(__AVX__)
    return _mm256_movemask_pd((__m256d)folded) != 0;
#elif defined(__x86_64__)
    return _mm_movemask_pd((__m128d)folded) != 0;
#else
    for (int i = 0; i < native_lanes; ++i)
      if (folded[i]) return true;
    return false;
#endif
  }
};

template <int W>
struct Pack {
  static_assert(W % native_lanes == 0, "a pack is a whole number of native vectors");
  static constexpr int width = W;
  static constexpr int parts = W / native_lanes;
  NativeVector part[parts];

  Pack() = default;
  Pack(double s) {
    for (int k = 0; k < parts; ++k) part[k] = in_all(s);
  }
  static Pack load(const double* from) {
    Pack r;
    std::memcpy(&r.part, from, sizeof r.part);
    return r;
  }
  void store(double* to) const { std::memcpy(to, &part, sizeof part); }
  double operator[](int lane) const { return part[lane / native_lanes][lane % native_lanes]; }
  void set(int lane, double value) { part[lane / native_lanes][lane % native_lanes] = value; }

  friend Pack operator+(Pack a, const Pack& b) {
    for (int k = 0; k < parts; ++k) a.part[k] += b.part[k];
    return a;
  }
  friend Pack operator-(Pack a, const Pack& b) {
    for (int k = 0; k < parts; ++k) a.part[k] -= b.part[k];
    return a;
  }
  friend Pack operator*(Pack a, const Pack& b) {
    for (int k = 0; k < parts; ++k) a.part[k] *= b.part[k];
    return a;
  }
  friend Pack operator/(Pack a, const Pack& b) {
    for (int k = 0; k < parts; ++k) a.part[k] = native_quotient(a.part[k], b.part[k]);
    return a;
  }
  friend Pack operator-(Pack a) {
    for (int k = 0; k < parts; ++k) a.part[k] = -a.part[k];
    return a;
  }
  Pack& operator+=(const Pack& b) { return *this = *this + b; }
  Pack& operator-=(const Pack& b) { return *this = *this - b; }
  Pack& operator*=(const Pack& b) { return *this = *this * b; }

  friend Mask<W> operator<(const Pack& a, const Pack& b) {
    Mask<W> r;
    for (int k = 0; k < parts; ++k) r.part[k] = a.part[k] < b.part[k];
    return r;
  }
  friend Mask<W> operator<=(const Pack& a, const Pack& b) {
    Mask<W> r;
    for (int k = 0; k < parts; ++k) r.part[k] = a.part[k] <= b.part[k];
    return r;
  }
  friend Mask<W> operator>(const Pack& a, const Pack& b) { return b < a; }
  friend Mask<W> operator>=(const Pack& a, const Pack& b) { return b <= a; }

  friend Pack select(const Mask<W>& m, Pack a, const Pack& b) {
    for (int k = 0; k < parts; ++k) a.part[k] = m.part[k] ? a.part[k] : b.part[k];
    return a;
  }
  friend Pack fused(Pack a, const Pack& b, const Pack& c) {
    for (int k = 0; k < parts; ++k) a.part[k] = fused(a.part[k], b.part[k], c.part[k]);
    return a;
  }
  friend Pack sqrt(Pack a) {
    for (int k = 0; k < parts; ++k) a.part[k] = native_sqrt(a.part[k]);
    return a;
  }
  friend std::pair<Pack, Pack> root_and_slope(const Pack& a) {
    std::pair<Pack, Pack> r;
    for (int k = 0; k < parts; ++k) {
      const auto [root, slope] = native_root_and_slope(a.part[k]);
      r.first.part[k] = root;
      r.second.part[k] = slope;
    }
    return r;
  }
  friend Pack abs(Pack a) {
    for (int k = 0; k < parts; ++k) a.part[k] = (NativeVector)((NativeMask)a.part[k] & INT64_MAX);
    return a;
  }
  // Where one argument is NaN both take b, as the vector instructions do: test results that may be NaN, do not min or max them.
  friend Pack min(const Pack& a, const Pack& b) { return select(a < b, a, b); }
  friend Pack max(const Pack& a, const Pack& b) { return select(a > b, a, b); }

  friend Pack rough_inverse_root(Pack a, auto n) {
    for (int k = 0; k < parts; ++k) a.part[k] = rough_inverse_root_of<NativeVector, NativeMask>(a.part[k], n);
    return a;
  }
};

// The same number, whose value the compiler does not know: it stays in its register, and is not loaded for each use.
template <int W>
[[gnu::always_inline]] inline Pack<W> in_register(Pack<W> a) {
#if defined(__x86_64__)
  for (int k = 0; k < Pack<W>::parts; ++k) asm("" : "+v"(a.part[k]));
#endif
  return a;
}

// The same vocabulary for one plain double.
inline double in_register(double a) { return a; }
inline double select(bool m, double a, double b) { return m ? a : b; }
inline double sqrt(double a) { return std::sqrt(a); }
inline std::pair<double, double> root_and_slope(double a) { return {std::sqrt(a), 0.5 / std::sqrt(a)}; }
inline double abs(double a) { return std::abs(a); }
inline double min(double a, double b) { return a < b ? a : b; }
inline double max(double a, double b) { return a > b ? a : b; }
inline bool any(bool m) { return m; }
inline double rough_inverse_root(double a, auto n) { return rough_inverse_root_of<double, std::int64_t>(a, n); }

// Width, lane access and mask of a number type.
template <class P>
struct lanes_of {
  using mask = Mask<P::width>;
  static constexpr int width = P::width;
  static mask none() { return mask::none(); }
  static double get(const P& a, int lane) { return a[lane]; }
  static bool get(const mask& m, int lane) { return m[lane]; }
  static void set(P& a, int lane, double value) { a.set(lane, value); }
  static void set(mask& m, int lane, bool on) { m.set(lane, on); }
};
template <>
struct lanes_of<double> {
  using mask = bool;
  static constexpr int width = 1;
  static mask none() { return false; }
  static double get(double a, int) { return a; }
  static bool get(bool m, int) { return m; }
  static void set(double& a, int, double value) { a = value; }
  static void set(bool& m, int, bool on) { m = on; }
};
template <class P>
using mask_of_lanes = typename lanes_of<P>::mask;

}  // namespace fisherpoint
