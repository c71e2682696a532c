// How many there are of what in a model. Of a compiled model the counts are types, so loops over them are unrolled and arrays
// live in registers; of a tape (tape.hpp) they are known when the program runs. Code that takes its counts from a Shape and its
// arrays from Numbers serves both.
#pragma once

#include <type_traits>

#include "fisherpoint/models/model.hpp"
#include "fisherpoint/numbers/arrays.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

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
  static constexpr Count<S::jumps + S::steep_kinks> holds_end{};  // of those that may hold trajectories (sliding.hpp)
  static constexpr Count<S::switching> kinks_end{};
  static constexpr Count<S::sides> sides{};
  static constexpr Count<S::surfaces> surfaces{};
  static constexpr Count<S::measured> measured{};  // limits behind the surfaces, which hold where g is measured
  static constexpr Count<S::surfaces + S::measured> values{};
  // Whether limits read sides.
  static constexpr bool sided_limits =
      requires(const M model, const std::array<double, S::states> x, const std::array<double, S::inputs> u,
               const std::array<double, S::parameters> theta,
               const std::array<double, S::sides> side) { model.limits(x, u, theta, side); };
  static constexpr Count<0> resets{}, updates{};
  static constexpr bool unrolled = true;  // its loops over stages
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

// Of a model that sets states anew. Those of one instant are bits of a number that a double holds.
inline constexpr int most_resets = 32;

// Whether a segment of a run has to know how the last one ended.
constexpr bool goes_on_from_ends(const auto& shape) { return shape.jumps_end > 0 || shape.resets > 0; }

// Whether the equations of a model may set states anew (tape_equations.hpp).
template <class Equation>
inline constexpr bool has_resets = requires { Equation::with_resets; };

template <class M, class T>
struct ArraysOf {
  using States = Numbers<T, std::remove_const_t<decltype(Shape<M>::states)>>;
  using Inputs = Numbers<T, std::remove_const_t<decltype(Shape<M>::inputs)>>;
  using Outputs = Numbers<T, std::remove_const_t<decltype(Shape<M>::outputs)>>;
  using Parameters = Numbers<T, std::remove_const_t<decltype(Shape<M>::parameters)>>;
  using Sides = Numbers<T, std::remove_const_t<decltype(Shape<M>::sides)>>;
  using Surfaces = Numbers<T, std::remove_const_t<decltype(Shape<M>::values)>>;
};

}  // namespace fisherpoint
