// The levels of the instruction set that this machine has.
#pragma once

#include <string>
#include <vector>

namespace fisherpoint {

// The best one last. Not to be asked by what is compiled for a level itself: its initializers run before `main`.
inline std::vector<std::string> supported_levels() {
  std::vector<std::string> levels{"generic"};
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("x86-64-v2")) levels.push_back("v2");
  if (__builtin_cpu_supports("x86-64-v3")) levels.push_back("v3");
  if (__builtin_cpu_supports("x86-64-v4")) levels.push_back("v4");
#endif
  return levels;
}

}  // namespace fisherpoint
