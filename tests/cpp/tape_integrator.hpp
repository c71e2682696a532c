// The integrator of tapes is that of the kernels, as it ships, and on as many lanes: tests do not compile it again.
#pragma once

#include "fisherpoint/equations/tape_equations.hpp"
#include "fisherpoint/equations/tape_lanes.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/tableau.hpp"

namespace fisherpoint {

extern template class Integrator<StateEquation<TapeModel, Pack<tape_lanes>>, Tableau>;

}  // namespace fisherpoint
