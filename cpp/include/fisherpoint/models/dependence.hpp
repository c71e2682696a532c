// What depends on what in a model: which entries f_x, f_theta and S have at all, whatever the numbers.
//
// Types show it of a compiled model (dual.hpp), so all of this is known to the compiler. Sets of variables are bit masks; of a
// tape they may be larger (variable_sets.hpp).
#pragma once

#include <array>
#include <bit>

#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/models/variable_sets.hpp"
#include "fisherpoint/numbers/dual.hpp"

namespace fisherpoint {

// A set that is known to the compiler.
template <Variables M>
using Set = std::integral_constant<Variables, M>;

// f(k) for every k in a set of either kind.
template <Variables M>
void for_each_variable(Set<M>, auto&& f) {
  for_each_variable<M>(f);
}
constexpr void for_each_variable(Variables set, auto&& f) {
  for (; set; set &= set - 1) f(std::countr_zero(set));
}

template <Variables A, Variables B>
constexpr Set<(A & B)> both(Set<A>, Set<B>) {
  return {};
}

namespace detail {

// The numbers below n for which belongs(i).
constexpr Variables which(int n, auto&& belongs) {
  Variables mask = 0;
  for (int i = 0; i < n; ++i)
    if (belongs(i)) mask |= Variables{1} << i;
  return mask;
}

constexpr bool has(Variables set, int i) { return (set >> i) & 1; }
// How many of a set are below i.
constexpr int below(Variables set, int i) { return std::popcount(set & ((Variables{1} << i) - 1)); }

// Which parameters state i depends on in the end: those that f_i reads and those of the states that it reads.
template <class Masks>
constexpr Masks reached_parameters(const Masks& states_read, const Masks& parameters_read, int states) {
  Masks reached = parameters_read;
  for (int round = 0; round < states; ++round)
    for (int i = 0; i < states; ++i)
      for (int k = 0; k < states; ++k)
        if ((states_read[i] >> k) & 1) reached[i] |= reached[k];
  return reached;
}

// Where the entries of row i begin, if the rows of an array follow each other.
template <class Starts>
constexpr Starts row_starts(Starts starts, int rows, auto&& row) {
  for (int i = 0, at = 0; i < rows; at += std::popcount(row(i++))) starts[i] = at;
  return starts;
}

// Of entries that change along a trajectory and of those that do not, in two numberings.
template <class Places>
struct PlacesKept {
  Places at;
  int entries = 0, changing = 0, constant = 0;

  constexpr void add(bool is_constant) { at[entries++] = is_constant ? ~constant++ : changing++; }
};

}  // namespace detail

template <int first, int n, class P>
auto as_variables(const auto& values) {
  return [&]<int... i>(std::integer_sequence<int, i...>) {
    return std::tuple{variable<first + i>(P(values[i]))...};
  }(std::make_integer_sequence<int, n>{});
}

template <class M>
class Dependence {
  static constexpr int n_x = sizes<M>::states, p = sizes<M>::parameters;
  static_assert(n_x + p <= 64, "a mask holds 64 variables");

  using X = decltype(as_variables<0, n_x, double>(std::array<double, n_x>{}));
  using Theta = decltype(as_variables<n_x, p, double>(std::array<double, p>{}));
  using U = std::array<double, sizes<M>::inputs>;
  using Rates = decltype(std::declval<const M&>().dynamics(std::declval<Theta>())(
      std::declval<X>(), std::declval<U>(), std::declval<std::array<double, sizes<M>::sides>>()));
  using Outputs = decltype(std::declval<const M&>().output(std::declval<X>(), std::declval<U>(), std::declval<Theta>()));
  using Switching = decltype(std::declval<const M&>().switching(std::declval<X>(), std::declval<U>(), std::declval<Theta>()));

  static constexpr Variables low = (Variables{1} << n_x) - 1;
  template <class Values, int n>
  static constexpr auto variables_in() {
    return []<int... i>(std::integer_sequence<int, i...>) {
      return std::array<Variables, n>{variables_of<std::tuple_element_t<i, Values>>...};
    }(std::make_integer_sequence<int, n>{});
  }

  // What the jumps read whose sides f_i reads: through the times at which these are met, state i depends on it.
  static constexpr std::array<Variables, n_x> read_through_jumps() {
    if constexpr (requires { M::read_through_jumps; }) {
      return M::read_through_jumps;
    } else if constexpr (sizes<M>::jumps == 0) {
      return {};
    } else {
      using Side = decltype(as_variables<0, sizes<M>::sides, double>(std::array<double, sizes<M>::sides>{}));
      using RatesBySide = decltype(std::declval<const M&>().dynamics(std::declval<std::array<double, p>>())(
          std::declval<std::array<double, n_x>>(), std::declval<U>(), std::declval<Side>()));
      constexpr auto sides_read = variables_in<RatesBySide, n_x>();
      constexpr auto by_surface = variables_in<Switching, sizes<M>::switching>();
      std::array<Variables, n_x> read{};
      for (int i = 0; i < n_x; ++i)
        for (int m = 0; m < sizes<M>::jumps; ++m)
          if ((sides_read[i] >> m) & 1) read[i] |= by_surface[m];
      return read;
    }
  }
  static constexpr auto read_by(bool parameters) {
    auto read = variables_in<Rates, n_x>();
    for (int i = 0; i < n_x; ++i) {
      read[i] |= read_through_jumps()[i];
      read[i] = parameters ? read[i] >> n_x : read[i] & low;
    }
    return read;
  }
  static constexpr auto states_read = read_by(false), parameters_read = read_by(true);
  static constexpr auto row = detail::reached_parameters(states_read, parameters_read, n_x);

  template <class Value>
  static constexpr bool varies() {
    if (variables_of<Value> >> n_x) return true;
    for (int k = 0; k < n_x; ++k)
      if (((variables_of<Value> >> k) & 1) && row[k]) return true;
    return false;
  }
  static constexpr Variables rows_of(int j) {
    return detail::which(n_x, [j](int i) { return (row[i] >> j) & 1; });
  }
  static constexpr Variables driven_of(int j) {
    return detail::which(n_x, [j](int i) { return (parameters_read[i] >> j) & 1; });
  }
  static constexpr bool alike(int j, int k) { return rows_of(j) == rows_of(k); }
  static constexpr Variables driven_alike(int j) {
    return detail::which(
        n_x, [j](int i) { return (parameters_read[i] & detail::which(p, [j](int k) { return alike(j, k); })) != 0; });
  }
  static constexpr Variables sensitive_states = detail::which(n_x, [](int i) { return row[i] != 0; });
  static constexpr Variables coupled_of(int i) {
    return detail::which(n_x, [i](int k) { return ((states_read[i] >> k) & 1) && row[k] != 0; });
  }

 public:
  // Of column j of S: the states that depend on parameter j, and those whose f reads it.
  template <int j>
  static constexpr Set<rows_of(j)> rows(Count<j>) {
    return {};
  }
  template <int j>
  static constexpr Set<driven_of(j)> driven(Count<j>) {
    return {};
  }
  // The states whose f reads any parameter with the pattern of column j: those columns have one code.
  template <int j>
  static constexpr Set<driven_alike(j)> driven_in_group(Count<j>) {
    return {};
  }
  // The parameters that f_i reads, and the states that it reads and that depend on any parameter.
  template <int i>
  static constexpr Set<parameters_read[i]> parameters_of(Count<i>) {
    return {};
  }
  template <int i>
  static constexpr Set<coupled_of(i)> coupled(Count<i>) {
    return {};
  }
  // The states that have derivatives by any parameter.
  static constexpr Set<sensitive_states> sensitive() { return {}; }
  static constexpr bool depends(int i, int j) { return (row[i] >> j) & 1; }
  // Whether state i, output i or switching surface m depends on any parameter: a state that does not is the same for every
  // theta, such an output has exactly no predictive variance, and such a surface is crossed at the same time. Branches on
  // values that depend on theta do not show in derivatives: a model that has any says itself what varies.
  static constexpr bool state_depends(int i) {
    if constexpr (requires { M::varying_states; })
      return M::varying_states[i];
    else
      return row[i] != 0;
  }
  template <int i>
  static constexpr bool output_depends(Count<i>) {
    if constexpr (requires { M::varying_outputs; })
      return M::varying_outputs[i];
    else
      return varies<std::tuple_element_t<i, Outputs>>();
  }
  template <int m>
  static constexpr bool switching_depends(Count<m>) {
    if constexpr (m < sizes<M>::switching && requires { M::varying_surfaces; })
      return M::varying_surfaces[m];
    else if constexpr (m < sizes<M>::switching)
      return varies<std::tuple_element_t<m, Switching>>();
    else
      return true;
  }

  // Whether a trajectory may cross jump m, or slide on it: not where another surface reads its side.
  static constexpr bool crossable(int m) {
    if constexpr (requires { M::crossable; })
      return M::crossable[m];
    else
      return true;
  }

  // Whether f_x may have no bounds, or be like a root, beside kink or limit m.
  static constexpr bool rough(int m) {
    if constexpr (requires { M::rough; })
      if (m < sizes<M>::switching) return M::rough[m];
    return m >= sizes<M>::switching;
  }

  // Whether f_x has no bounds beside jump or kink m, as f takes a root of what is zero there; and whether there is any such.
  static constexpr bool steep(int m) {
    if constexpr (requires { M::steep; })
      return m < sizes<M>::switching && M::steep[m];
    else
      return false;
  }
  static constexpr bool any_steep() {
    for (int m = 0; m < sizes<M>::switching; ++m)
      if (steep(m)) return true;
    return false;
  }

  // Whether f has a value where limit m, which is no pole, is zero; and whether there is any such.
  static constexpr bool closed(int m) {
    if constexpr (requires { M::closed; })
      return m >= sizes<M>::sides && M::closed[m - sizes<M>::sides];
    else
      return false;
  }
  static constexpr bool any_closed() {
    for (int m = sizes<M>::sides; m < sizes<M>::surfaces; ++m)
      if (closed(m)) return true;
    return false;
  }

  // How many outputs depend on any parameter.
  static constexpr int varying_outputs = []<int... i>(std::integer_sequence<int, i...>) {
    return (0 + ... + output_depends(Count<i>{}));
  }(std::make_integer_sequence<int, sizes<M>::outputs>{});

  // Where the entries are: of f_x row by row, of f_theta and of S column by column.
  static constexpr auto state_start = detail::row_starts(std::array<int, n_x>{}, n_x, coupled_of);
  static constexpr auto theta_start = detail::row_starts(std::array<int, p>{}, p, driven_of);
  static constexpr auto column_start = detail::row_starts(std::array<int, p>{}, p, rows_of);

 private:
  static constexpr int total(int n, auto&& mask_of) {
    int sum = 0;
    for (int i = 0; i < n; ++i) sum += std::popcount(mask_of(i));
    return sum;
  }
  static constexpr auto place_of_drives = [] {
    std::array<std::array<int, n_x>, p> at{};
    for (int j = 0; j < p; ++j)
      for (int i = 0; i < n_x; ++i)
        at[j][i] = (driven_of(j) >> i) & 1 ? theta_start[j] + detail::below(driven_of(j), i) : total(p, driven_of);
    return at;
  }();
  static constexpr auto places_kept = [] {
    detail::PlacesKept<std::array<int, total(n_x, coupled_of) + total(p, driven_of)>> places{};
    const auto constant = [](int i, int k) {
      if constexpr (requires { M::constant_slopes; }) return (M::constant_slopes[i] >> k) & 1;
      return Variables{0};
    };
    for (int i = 0; i < n_x; ++i) for_each_variable(coupled_of(i), [&](int k) { places.add(constant(i, k)); });
    for (int j = 0; j < p; ++j) for_each_variable(driven_of(j), [&](int i) { places.add(constant(i, n_x + j)); });
    return places;
  }();
  // For every column the first one of its pattern, and the next one, or p.
  static constexpr std::array<std::array<int, 2>, p> patterns = [] {
    std::array<std::array<int, 2>, p> of{};
    for (int j = 0; j < p; ++j) {
      int& leader = of[j][0] = 0;
      while (!alike(leader, j)) ++leader;
      int& next = of[j][1] = j + 1;
      while (next < p && !alike(next, j)) ++next;
    }
    return of;
  }();

 public:
  static constexpr Count<total(n_x, coupled_of)> by_state{};   // entries of f_x
  static constexpr Count<total(p, driven_of) + 1> by_theta{};  // of f_theta, and behind them a zero
  static constexpr Count<total(p, rows_of)> in_columns{};      // of S

  // How many entries of f_x and f_theta may change along a trajectory that stays on its sides of the jumps, and how many do
  // not. Entry e, those of f_x first, is number kept_at(e) of the former or number ~kept_at(e) of the latter.
  static constexpr Count<places_kept.changing> changing{};
  static constexpr Count<places_kept.constant> constant{};
  static constexpr int kept_at(int e) { return places_kept.at[e]; }

  // Where the derivative of f_i by parameter j is among the entries of f_theta; of one that is no entry, the zero's place.
  static constexpr int drive_at(int j, int i) { return place_of_drives[j][i]; }

  // The first of the parameters whose columns have the pattern of column j, and the next one after j that has it, or p.
  static constexpr int leader(int j) { return patterns[j][0]; }
  static constexpr int next_alike(int j) { return patterns[j][1]; }
};

template <Model M>
Dependence<M> dependence_of(const M&) {
  return {};
}

}  // namespace fisherpoint
