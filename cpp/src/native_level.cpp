// Prints the best level that this machine has, for which CMake then compiles.
#include <cstdio>

#include "fisherpoint/kernels/supported_levels.hpp"

int main() { return std::fputs(fisherpoint::supported_levels().back().c_str(), stdout) < 0; }
