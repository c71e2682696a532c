// Functions that compute what the lists of a tape's programs say (tape.hpp), from a shared object that is built for one model
// while the program runs: types of C alone, and no exception. A change here is a new version.
#pragma once

#include <cstdint>

extern "C" {

enum : std::int32_t { fisherpoint_straight_version = 2 };

// What a program reads: packs, one behind the other; of what it does not read, any pointers.
struct FisherpointLeaves {
  const double *theta, *u, *x, *side, *dx;
};

struct FisherpointProgram {
  std::int32_t lanes, register_bytes;  // of a pack, and of the vectors that the instruction set has
  std::int32_t packs;                  // that `own` has: the outputs first
  // Of the first `used` lanes, whole vectors.
  void (*setup)(const FisherpointLeaves* leaves, double* own, std::int32_t used);  // reads theta and u alone
  void (*stage)(const FisherpointLeaves* leaves, double* own, std::int32_t used);
};

struct FisherpointPrograms {
  std::int32_t version;  // the first of every version
  FisherpointProgram rates, output, surfaces, surface_rates, state_jacobian, rate_jacobian, output_jacobian, jump_jacobian;
  FisherpointProgram resets, reset_jacobian, updates, update_jacobian;  // empty where the model has none
};

// The shared object's only function, `fisherpoint_programs`.
using FisherpointStraight = const FisherpointPrograms*();

}  // extern "C"
