// How many lanes a tape's lists are carried out on at a time.
#pragma once

#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

// Enough for the arithmetic to outweigh the decoding of an operation, few enough for the registers to stay in the cache.
inline constexpr int tape_lanes = native_lanes < 8 ? 16 : 32;

}  // namespace fisherpoint
