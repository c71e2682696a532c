#define DOCTEST_CONFIG_IMPLEMENT
#include <doctest/doctest.h>

#include <cstdio>

int main(int argc, char** argv) {
#if defined(__AVX512F__)
  const bool supported = __builtin_cpu_supports("x86-64-v4");
#elif defined(__AVX2__)
  const bool supported = __builtin_cpu_supports("x86-64-v3");
#else
  const bool supported = true;
#endif
  if (!supported) {
    std::puts("skipped: this machine lacks the instruction set");
    return 77;
  }
  return doctest::Context(argc, argv).run();
}
