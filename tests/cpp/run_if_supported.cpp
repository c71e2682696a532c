// run_if_supported LEVEL PROGRAM [ARGUMENT...]: runs the program where the machine has the level (v2, v3, v4, generic); 77, by
// which ctest knows a test that is skipped, where not. A program that is compiled for a level cannot ask by itself: its
// initializers run before `main`.
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "fisherpoint/kernels/supported_levels.hpp"

int main(int argc, char** argv) {
  if (argc < 3) return std::puts("expected a level and a program"), 1;
  if (!std::ranges::count(fisherpoint::supported_levels(), argv[1]))
    return std::printf("skipped: this machine lacks the instruction set %s\n", argv[1]), 77;
  execv(argv[2], argv + 2);
  std::perror(argv[2]);
  return 1;
}
