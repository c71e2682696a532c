// The first native vector of a pack, as a pack of its own. Where few lanes are in use they are in it, and work on it alone
// gives them the same bits.
#pragma once

#include <type_traits>

#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

// Of a number, a pack, a mask, or what consists of packs (elimination.hpp).
template <class T>
struct FirstPart {
  using type = T;
  static T get(const T& from) { return from; }
  static void set(T& to, const T& value) { to = value; }
};
template <int W>
struct FirstPart<Pack<W>> {
  using type = Pack<native_lanes>;
  static type get(const Pack<W>& from) {
    type first;
    first.part[0] = from.part[0];
    return first;
  }
  static void set(Pack<W>& to, const type& value) { to.part[0] = value.part[0]; }
};
template <int W>
struct FirstPart<Mask<W>> {
  using type = Mask<native_lanes>;
  static void set(Mask<W>& to, const type& value) { to.part[0] = value.part[0]; }
};

// `from` as Q: all of it, or its first part.
template <class Q, class T>
decltype(auto) read_as(const T& from) {
  if constexpr (std::is_same_v<Q, T>)
    return (from);
  else
    return FirstPart<T>::get(from);
}
template <class T, class Q>
void write_as(T& to, const Q& value) {
  if constexpr (std::is_same_v<Q, T>)
    to = value;
  else
    FirstPart<T>::set(to, value);
}

// Whether the first part has as many lanes as are in use.
template <class P>
constexpr bool first_part_suffices(int used) {
  return used <= lanes_of<typename FirstPart<P>::type>::width;
}

// A type, as an argument.
template <class T>
struct As {};

// work(As<Q>{}) with Q the numbers of an equation, or the first part of them where that is all that is in use.
template <class Equation>
void on_lanes_in_use(const Equation& f, auto&& work) {
  using P = typename Equation::Number;
  if constexpr (!requires { typename std::bool_constant<Equation::first_part_alone()>; })
    if (f.first_part_alone()) return work(As<typename FirstPart<P>::type>{});
  work(As<P>{});
}

}  // namespace fisherpoint
