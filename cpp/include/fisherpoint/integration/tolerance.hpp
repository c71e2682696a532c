// How exactly trajectories are integrated, and by which method.
#pragma once

#include "fisherpoint/integration/dormand_prince.hpp"
#include "fisherpoint/integration/dormand_prince_853.hpp"
#include "fisherpoint/integration/tableau.hpp"
#include "fisherpoint/models/shape.hpp"

namespace fisherpoint {

// fastest: DOP853, and where that is stiff Radau.
enum class MethodName { fastest, RK45, DOP853, Radau };

// f<the method>(). DOP853 is the faster one at every tolerance that we tried (docs/studies/performance.md): an embedded pair of
// order eight gains so much from ending its steps on the kinks.
template <class M>
auto with_method(MethodName name, auto&& f) {
  if constexpr (!Shape<M>::unrolled) {
    return f.template operator()<Tableau>();
  } else {
    if (name == MethodName::RK45) return f.template operator()<DormandPrince>();
    return f.template operator()<DormandPrince853>();
  }
}

// The local error of a step is held this far below the requested tolerance, so that the global error meets it.
inline constexpr double local_share = 0.7;

struct Tolerance {
  double relative = 1e-6;    // of x(dt), in units of the states' scales
  int max_attempts = 20000;  // tried steps of one trajectory
  bool cross_kinks = true;   // false: a kink ends the trajectory as met_kink
  bool cross_jumps = false;  // false: a jump whose time depends on theta ends the trajectory as met_jump
  MethodName method = MethodName::fastest;
  // Of sensitivities of short pieces of a trajectory: the first step tried is the whole piece, and where one starts or ends on
  // a jump, the derivative is that of the side where it runs.
  bool whole_first = false;

  // Of squared errors in units of the states' scales: a step is good up to 1.
  double step_weight() const { return 1.0 / (local_share * relative * local_share * relative); }
};

// The constants of a method; of a tableau, that of the name.
template <class Method>
const Method& method_of(const Tolerance&) {
  static constexpr Method constants{};
  return constants;
}
template <>
inline const Tableau& method_of(const Tolerance& tolerance) {
  static constexpr Tableau of_54(DormandPrince{}), of_853(DormandPrince853{});
  return tolerance.method == MethodName::RK45 ? of_54 : of_853;
}

}  // namespace fisherpoint
