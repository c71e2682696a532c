// How many there are of what in a model, and arrays of so many numbers. Of a compiled model the counts are types, so loops over
// them are unrolled and arrays live in registers; of a tape (tape.hpp) they are known when the program runs. Code that takes
// its counts from a Shape and its arrays from Numbers serves both.
#pragma once

#include <algorithm>
#include <array>
#include <type_traits>

#include "heap_array.hpp"
#include "model.hpp"
#include "unroll.hpp"

namespace fisherpoint {

namespace detail {
template <class T, class N>
struct NumbersOf {
  using type = HeapArray<T>;
};
template <class T, int n>
struct NumbersOf<T, Count<n>> {
  using type = std::array<T, n>;
};
}  // namespace detail

template <class T, class N>
using Numbers = typename detail::NumbersOf<T, N>::type;

namespace detail {
template <class Array, class T>
struct OfAnother;
template <class S, std::size_t n, class T>
struct OfAnother<std::array<S, n>, T> {
  using type = std::array<T, n>;
};
template <class S, class T>
struct OfAnother<HeapArray<S>, T> {
  using type = HeapArray<T>;
};
}  // namespace detail

// As many of type T as Array has entries.
template <class Array, class T>
using Retyped = typename detail::OfAnother<Array, T>::type;

// Gives an array its size, if it does not have it by its type.
template <class T, std::size_t n>
void fit(std::array<T, n>&, auto) {}
template <class T>
void fit(HeapArray<T>& array, int n) {
  array = HeapArray<T>(n);
}

// Surfaces are numbered: jumps, kinks, poles, domain limits. All but the limits have a side on which the trajectory runs; a
// pole is where a denominator is zero, a limit of the domain from either side.
template <class M>
struct Shape {
  using S = sizes<M>;
  static constexpr Count<S::states> states{};
  static constexpr Count<S::inputs> inputs{};
  static constexpr Count<S::outputs> outputs{};
  static constexpr Count<S::parameters> parameters{};
  static constexpr Count<S::jumps> jumps_end{};
  static constexpr Count<S::switching> kinks_end{};
  static constexpr Count<S::sides> sides{};
  static constexpr Count<S::surfaces> surfaces{};
  // How loops over n stages are counted.
  template <int n>
  using Stages = Count<n>;
};

template <Model M>
Shape<M> shape_of(const M&) {
  return {};
}

// Of state i, against whose natural size errors are measured.
template <Model M>
constexpr double inverse_scale(const M&, int i) {
  return 1.0 / M::states[i].scale;
}

template <class M, class T>
struct ArraysOf {
  using States = Numbers<T, std::remove_const_t<decltype(Shape<M>::states)>>;
  using Inputs = Numbers<T, std::remove_const_t<decltype(Shape<M>::inputs)>>;
  using Outputs = Numbers<T, std::remove_const_t<decltype(Shape<M>::outputs)>>;
  using Parameters = Numbers<T, std::remove_const_t<decltype(Shape<M>::parameters)>>;
  using Sides = Numbers<T, std::remove_const_t<decltype(Shape<M>::sides)>>;
  using Surfaces = Numbers<T, std::remove_const_t<decltype(Shape<M>::surfaces)>>;
};

}  // namespace fisherpoint
