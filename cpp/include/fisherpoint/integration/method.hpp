// Which Runge-Kutta method integrates.
#pragma once

#include "fisherpoint/integration/dormand_prince.hpp"
#include "fisherpoint/integration/dormand_prince_853.hpp"

namespace fisherpoint {

enum class MethodName { fastest, RK45, DOP853 };

// f(the method). DOP853 is the faster one at every tolerance that we tried (docs/performance.md): an embedded pair of order
// eight gains so much from ending its steps on the kinks.
auto with_method(MethodName name, auto&& f) {
  if (name == MethodName::RK45) return f(DormandPrince{});
  return f(DormandPrince853{});
}

}  // namespace fisherpoint
