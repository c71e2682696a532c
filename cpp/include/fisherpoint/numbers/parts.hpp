// Packs by their parts, which are native vectors. A loop over long arrays that works on one part after the other keeps what it
// needs in registers. Where few lanes are in use, the first ones, it leaves out the parts behind them: the code is the same,
// and so are the bits of what is in use.
#pragma once

#include <type_traits>

#include "fisherpoint/numbers/pack.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// Of a number, a pack, a mask, or what consists of packs (elimination.hpp).
template <class T>
struct PartsOf {
  using type = T;
  static constexpr int count = 1;
  static const T& get(const T& from, int) { return from; }
  static void set(T& to, int, const T& value) { to = value; }
};
template <template <int> class Of, int W>  // a pack or a mask
struct PartsOf<Of<W>> {
  using type = Of<native_lanes>;
  static constexpr int count = Of<W>::parts;
  static type get(const Of<W>& from, int k) {
    type part;
    part.part[0] = from.part[k];
    return part;
  }
  static void set(Of<W>& to, int k, const type& value) { to.part[k] = value.part[0]; }
};
template <class T>
using PartOf = typename PartsOf<T>::type;

// One of the parts: reads it in packs, and sets it there.
class Part {
 public:
  explicit Part(int number) : number_(number) {}
  template <class T>
  [[gnu::always_inline]] decltype(auto) operator()(const T& pack) const {
    return PartsOf<T>::get(pack, number_);
  }
  template <class T>
  [[gnu::always_inline]] void set(T& pack, const PartOf<T>& value) const {
    PartsOf<T>::set(pack, number_, value);
  }

 private:
  int number_;
};

// work(part) for the first `count` parts.
[[gnu::always_inline]] inline void for_each_part(int count, auto&& work) {
  for (int k = 0; k < count; ++k) work(Part(k));
}

// The same, where the compiler knows how many: each has instructions of its own, so that the processor does not take one part
// to wait for the part before it, where one call reads what another has written.
template <int count>
[[gnu::always_inline]] inline void for_each_part(Count<count>, auto&& work) {
  for_each_index<count>([&](auto k) { work(Part(k)); });
}

// How many parts have the first `used` lanes.
template <class P>
constexpr int parts_in_use(int used) {
  constexpr int lanes = lanes_of<PartOf<P>>::width;
  return used > lanes ? (used + lanes - 1) / lanes : 1;
}

// `from` as Q: all of it, or its first part.
template <class Q, class T>
decltype(auto) read_as(const T& from) {
  if constexpr (std::is_same_v<Q, T>)
    return (from);
  else
    return PartsOf<T>::get(from, 0);
}
template <class Q>
struct ReadAs {
  template <class T>
  decltype(auto) operator()(const T& from) const {
    return read_as<Q>(from);
  }
};
template <class T, class Q>
void write_as(T& to, const Q& value) {
  if constexpr (std::is_same_v<Q, T>)  // part by part: no whole pack goes through memory
    for_each_index<PartsOf<T>::count>([&](auto k) { PartsOf<T>::set(to, k, PartsOf<T>::get(value, k)); });
  else
    PartsOf<T>::set(to, 0, value);
}

// A type, as an argument.
template <class T>
struct As {};

// work(As<Q>{}) with Q the numbers of an equation, or their first part where that is all that is in use: for loops in which
// much is found once for all parts.
template <class Equation>
void on_all_or_first_part(const Equation& f, auto&& work) {
  using P = typename Equation::Number;
  if constexpr (!requires { typename std::bool_constant<Equation::parts_in_use() == 1>; })
    if (f.parts_in_use() == 1) return work(As<PartOf<P>>{});
  work(As<P>{});
}

}  // namespace fisherpoint
