#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template class Integrator<KernelEquation, DormandPrince>;
template class Integrator<KernelEquation, DormandPrince853>;

}  // namespace fisherpoint
