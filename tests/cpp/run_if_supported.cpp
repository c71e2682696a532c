// run_if_supported LEVEL PROGRAM [ARGUMENT...]: runs the program where the machine has the level (v2, v3, v4, generic); 77, by
// which ctest knows a test that is skipped, where not. A program that is compiled for a level cannot ask by itself: its
// initializers run before `main`.
#include <unistd.h>

#include <cstdio>
#include <string>

static bool supported(const std::string& level) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (level == "v2") return __builtin_cpu_supports("x86-64-v2");
  if (level == "v3") return __builtin_cpu_supports("x86-64-v3");
  if (level == "v4") return __builtin_cpu_supports("x86-64-v4");
#endif
  return level == "generic";
}

int main(int argc, char** argv) {
  if (argc < 3) return std::puts("expected a level and a program"), 1;
  if (!supported(argv[1])) return std::printf("skipped: this machine lacks the instruction set %s\n", argv[1]), 77;
  execv(argv[2], argv + 2);
  std::perror(argv[2]);
  return 1;
}
