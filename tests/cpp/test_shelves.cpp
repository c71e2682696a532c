#include <doctest/doctest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>
#include <vector>

#include "fisherpoint/kernels/workers.hpp"
#include "fisherpoint/numbers/heap_array.hpp"

using namespace fisherpoint;

TEST_CASE("what is dropped is given out again, while its thread works") {
  const Shelves shelves;
  void* const block = Shelves::take(100);
  void* const other = Shelves::take(1000);
  Shelves::drop(block, 100);
  Shelves::drop(other, 1000);
  CHECK(Shelves::take(128) == block);  // of as many cache lines
  CHECK(Shelves::take(1000) == other);
  {
    const Shelves inner;
    Shelves::drop(block, 100);
  }
  CHECK(Shelves::take(128) == block);  // there are no inner shelves that it could be gone with
  Shelves::drop(block, 128);
  Shelves::drop(other, 1000);
}

TEST_CASE("large blocks are given out again for what is not much smaller") {
  constexpr std::size_t large = 300'000;
  const Shelves shelves;
  void* const block = Shelves::take(large);
  void* const other = Shelves::take(large);
  Shelves::drop(block, large);
  Shelves::drop(other, large);
  void* const larger = Shelves::take(2 * large);
  CHECK(larger != block);
  CHECK(larger != other);
  CHECK(Shelves::take(large - 1000) == other);
  CHECK(Shelves::take(large) == block);
  Shelves::drop(block, large);
  Shelves::drop(other, large - 1000);
  Shelves::drop(larger, 2 * large);
}

TEST_CASE("a thread keeps what is small from one work to the next") {
  void *small, *large;
  {
    const Shelves shelves;
    small = Shelves::take(5000);
    large = Shelves::take(10 << 20);
    Shelves::drop(small, 5000);
    Shelves::drop(large, 10 << 20);
  }
  void* const between = Shelves::take(5000);
  CHECK(between != small);  // nobody works
  {
    const Shelves shelves;
    CHECK(Shelves::take(5000) == small);
    Shelves::drop(small, 5000);
    std::thread([&] {
      const Shelves of_another;
      void* const block = Shelves::take(5000);
      CHECK(block != small);
      Shelves::drop(block, 5000);
    }).join();
  }
  Shelves::drop(between, 5000);
}

TEST_CASE("arrays outlive the shelves that they came from, and may be dropped by another thread") {
  std::vector<HeapArray<double>> arrays(1000);
  Workers(4).for_each(arrays.size(), [&](std::size_t i) {
    HeapArray<double> array(static_cast<int>(1 + i % 7));
    array.fill(static_cast<double>(i));
    arrays[i] = array;
  });
  Workers(4).for_each(arrays.size(), [&](std::size_t i) {
    const auto& array = arrays[arrays.size() - 1 - i];
    CHECK(array.size() == 1 + (arrays.size() - 1 - i) % 7);
    for (const double value : array) CHECK(value == static_cast<double>(arrays.size() - 1 - i));
  });
  Workers(4).for_each(arrays.size(), [&](std::size_t i) { arrays[arrays.size() - 1 - i] = HeapArray<double>(3); });
  volatile int nothing = 0;  // or the compiler warns of a copy that is never made
  const HeapArray<double> none(nothing), copy = none;
  CHECK(copy == none);
  CHECK(copy.size() == 0);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which take more memory than any limit here
// Runs `work` in a process that can get no more memory than it has; its exit status, or -1 where it died of a signal.
static int with_no_memory_left(auto&& work) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_AS, &none);
    setrlimit(RLIMIT_DATA, &none);
    _exit(work());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_CASE("where memory is short, taking throws and dropping does not") {
  std::vector<HeapArray<double>> arrays(1000, HeapArray<double>(50));
  arrays.reserve(100000);
  CHECK(with_no_memory_left([&] {
          bool thrown = false;
          try {
            while (arrays.size() < arrays.capacity()) arrays.emplace_back(1 << 12);
          } catch (const std::bad_alloc&) {
            thrown = true;
          }
          const Shelves shelves;
          for (auto& array : arrays) HeapArray<double>(std::move(array));
          arrays.clear();
          return thrown ? 7 : 8;
        }) == 7);
}

TEST_CASE("where no thread can start, the calling one does the work") {
  CHECK(with_no_memory_left([] {
          int done = 0;  // by this thread alone
          try {
            Workers(8).for_each(100, [&](std::size_t) { ++done; });
          } catch (...) {
            return 9;
          }
          return done;
        }) == 100);
}
#endif
