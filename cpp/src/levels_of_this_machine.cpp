// Prints the levels that this machine has, as a list of CMake, the best last.
#include <cstdio>

#include "fisherpoint/kernels/supported_levels.hpp"

int main() {
  for (const auto& level : fisherpoint::supported_levels()) std::printf("%s%s", level == "generic" ? "" : ";", level.c_str());
}
