#include "models.hpp"

namespace fisherpoint {

template class Integrator<StateEquation<HydraulicCylinder, double>, DormandPrince853>;

}  // namespace fisherpoint
