// How a trajectory ended. Numerical trouble is a status, never an exception.
#pragma once

#include <cstdint>

namespace fisherpoint {

enum class Status : std::int32_t {
  ok = 0,
  met_jump = 1,     // f jumps there, and crossing jumps is forbidden
  left_domain = 2,  // f has no value past the limit
  step_limit = 3,   // the tolerance asks for more or smaller steps than allowed
  not_finite = 4,   // f or g returned NaN or infinity inside its domain
  met_kink = 5,     // only where crossing a kink is forbidden
  grazes_jump = 6,  // touches a jump along its tangent: the trajectory has no derivative
  on_jump = 7,      // starts or ends on a jump, where there is no derivative or more than one trajectory
  two_jumps = 8,    // meets several jumps at once, and how it goes on, or its derivative, is not one
  chatters = 9,     // meets jumps again and again within ever shorter times
};

}  // namespace fisherpoint
