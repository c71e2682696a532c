// The models that kernels are compiled for, and how many lanes they work on at a time.
#pragma once

#include <type_traits>

#include "fisherpoint/equations/state_equation.hpp"
#include "fisherpoint/equations/tape_equations.hpp"
#include "fisherpoint/equations/tape_lanes.hpp"
#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/models/hydraulic_cylinder.hpp"
#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

template <class M>
inline constexpr int lanes_for = native_lanes;
template <>
inline constexpr int lanes_for<TapeModel> = tape_lanes;

#if defined(FISHERPOINT_MODEL)
// Compiled once, in cpp/src/integrator.cpp and integrator_54.cpp: they are most of what a kernel takes to compile.
using KernelEquation = StateEquation<FISHERPOINT_MODEL, Pack<lanes_for<FISHERPOINT_MODEL>>>;
template <class Method>
using KernelMethod = std::conditional_t<Shape<FISHERPOINT_MODEL>::unrolled, Method, Tableau>;
extern template class Integrator<KernelEquation, KernelMethod<DormandPrince>>;
extern template class Integrator<KernelEquation, KernelMethod<DormandPrince853>>;
#endif

}  // namespace fisherpoint
