// Integrators of small models, for the tests of methods: of one level.
#include "models.hpp"

namespace fisherpoint {

using namespace testing;
using P = Pack<native_lanes>;

template class Integrator<StateEquation<Oscillator, double>, DormandPrince853>;
template class Integrator<StateEquation<Oscillator, P>, DormandPrince853>;
template class Integrator<StateEquation<Ball<Kind::kink>, double>, DormandPrince853>;
template class Integrator<StateEquation<Ball<Kind::kink>, P>, DormandPrince853>;
template class Integrator<StateEquation<Ball<Kind::jump>, P>, DormandPrince853>;

}  // namespace fisherpoint
