// The models that kernels are compiled for, and how many lanes they work on at a time.
#pragma once

#include "hydraulic_cylinder.hpp"
#include "pack.hpp"
#include "tape_equation.hpp"

namespace fisherpoint {

template <class M>
inline constexpr int lanes_for = native_lanes;
// Enough for the arithmetic to outweigh the decoding of an operation, few enough for the registers to stay in the cache.
template <>
inline constexpr int lanes_for<TapeModel> = native_lanes < 8 ? 8 * native_lanes : 32;

}  // namespace fisherpoint
