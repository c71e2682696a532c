// Loops over compile-time indices, for what differs in type from one index to the next or must stay in registers; the same
// loops where the count is known at run time only; and the mark for the functions that they are inlined into.
#pragma once

// Everything that a hot function calls is inlined into it; not under the sanitizers, whose checks would multiply without end.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define FISHERPOINT_SANITIZED
#define FISHERPOINT_HOT [[gnu::noinline]]
#else
#define FISHERPOINT_HOT [[gnu::flatten, gnu::noinline]]
#endif

#include <type_traits>
#include <utility>

namespace fisherpoint {

// The same truth, of which the compiler does not know that it stays what it was. It makes no copies of the code behind for both
// cases, in which it may fuse products and sums in other ways: a lane's bits do not depend on what its neighbours do.
[[gnu::always_inline]] inline bool unforeseen(bool given) {
  asm volatile("" : "+r"(given));
  return given;
}

// f(0), f(1), ... f(n - 1), each index an integral_constant.
template <int n, class F>
void for_each_index(F&& f) {
  [&]<int... i>(std::integer_sequence<int, i...>) {
    (f(std::integral_constant<int, i>{}), ...);
  }(std::make_integer_sequence<int, n>{});
}

// A count that is known to the compiler.
template <int n>
using Count = std::integral_constant<int, n>;

template <int n>
constexpr Count<n + 1> after(Count<n>) {
  return {};
}
constexpr int after(int n) { return n + 1; }
template <int n>
constexpr Count<n - 1> before(Count<n>) {
  return {};
}
constexpr int before(int n) { return n - 1; }

// The same for a count of either kind, and from `first` to `last - 1`.
template <int n>
void for_each_index(Count<n>, auto&& f) {
  for_each_index<n>(f);
}
void for_each_index(int n, auto&& f) {
  for (int i = 0; i < n; ++i) f(i);
}
template <int first, int last>
void for_each_index(Count<first>, Count<last>, auto&& f) {
  for_each_index<last - first>([&](auto i) { f(Count<first + i>{}); });
}
void for_each_index(int first, int last, auto&& f) {
  for (int i = first; i < last; ++i) f(i);
}

// f(n - 1), ..., f(0).
template <int n>
void for_each_index_down(Count<n>, auto&& f) {
  for_each_index<n>([&](auto i) { f(Count<n - 1 - i>{}); });
}
void for_each_index_down(int n, auto&& f) {
  while (n > 0) f(--n);
}

}  // namespace fisherpoint
