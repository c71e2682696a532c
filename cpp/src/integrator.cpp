#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template class Integrator<KernelEquation, KernelMethod<DormandPrince853>>;

}  // namespace fisherpoint
