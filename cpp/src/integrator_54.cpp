// Not of tapes, whose code for both methods is in integrator.cpp.
#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template class Integrator<KernelEquation, DormandPrince>;

}  // namespace fisherpoint
