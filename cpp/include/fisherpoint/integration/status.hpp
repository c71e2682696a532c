// How a trajectory ended. Numerical trouble is a status, never an exception.
#pragma once

#include <cstdint>

namespace fisherpoint {

enum class Status : std::int32_t {
  ok = 0,
  met_jump = 1,     // f jumps there: the trajectory is not differentiable with respect to theta
  left_domain = 2,  // f has no value past the limit
  step_limit = 3,   // the tolerance asks for more or smaller steps than allowed
  not_finite = 4,   // f or g returned NaN or infinity inside its domain
  met_kink = 5,     // only where crossing a kink is forbidden
};

}  // namespace fisherpoint
