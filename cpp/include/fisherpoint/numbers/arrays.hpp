// Arrays of N numbers: in registers where N is a type, on the heap where it is known at run time only.
#pragma once

#include <array>
#include <cstddef>

#include "fisherpoint/numbers/heap_array.hpp"
#include "fisherpoint/numbers/unroll.hpp"

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

template <class T, class N>
using Numbers = typename detail::NumbersOf<T, N>::type;

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

}  // namespace fisherpoint
