// The integrator of the cylinder in doubles, for the tests of every level.
#include "models.hpp"

namespace fisherpoint {

template class Integrator<StateEquation<HydraulicCylinder, double>, DormandPrince853>;

}  // namespace fisherpoint
