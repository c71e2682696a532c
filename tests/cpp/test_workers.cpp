#include <doctest/doctest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "fisherpoint/kernels/workers.hpp"

using namespace fisherpoint;

TEST_CASE("every item is done once") {
  for (int threads : {1, 2, 5}) {
    std::vector<std::atomic<int>> done(1000);
    Workers(threads).for_each(done.size(), [&](std::size_t i) { ++done[i]; });
    for (const auto& n : done) CHECK(n == 1);
  }
  Workers(3).for_each(0, [](std::size_t) { FAIL("there is no item"); });
}

TEST_CASE("an exception stops the work and arrives") {
  for (int threads : {1, 4}) {
    std::atomic<int> done = 0;
    CHECK_THROWS_AS(Workers(threads).for_each(100000,
                                              [&](std::size_t i) {
                                                if (i == 10) throw std::runtime_error("no");
                                                ++done;
                                                std::this_thread::yield();
                                              }),
                    std::runtime_error);
    CHECK(done < 100000);
  }
}

TEST_CASE("an interrupt stops the work within a moment") {
  std::atomic<int> asked = 0;
  const Workers workers(2, [&] { return ++asked >= 2; });
  const auto started = std::chrono::steady_clock::now();
  CHECK_THROWS_AS(workers.for_each(1 << 20, [](std::size_t) { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }),
                  Interrupted);
  CHECK(std::chrono::steady_clock::now() - started < std::chrono::seconds(5));
}

TEST_CASE("threads are kept, and serve callers side by side") {
  std::vector<std::jthread> callers;
  std::array<std::atomic<long>, 4> sums{};
  for (std::size_t caller = 0; caller < sums.size(); ++caller)
    callers.emplace_back([&sums, caller] {
      for (int call = 0; call < 200; ++call)
        Workers(3).for_each(20, [&](std::size_t i) { sums[caller] += static_cast<long>(i); });
    });
  callers.clear();
  for (const auto& sum : sums) CHECK(sum == 200 * 190);
}

TEST_CASE("who comes late finds the work closed, and nobody waits for him") {
  int parts = 0;
  SharedWork work([&] { ++parts; });
  work.take_part();
  work.close();
  work.take_part();
  CHECK(parts == 1);
}

TEST_CASE("work is closed when all who take part have left") {
  std::atomic<bool> begun = false, left = false;
  SharedWork work([&] {
    begun = true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    left = true;
  });
  const std::jthread other([&] { work.take_part(); });
  while (!begun) std::this_thread::yield();
  work.close();
  CHECK(left);
}

#if defined(__linux__)
TEST_CASE("threads have a megabyte of stack, however little the system gives by itself") {
  pthread_attr_t before, small;
  pthread_getattr_default_np(&before);
  pthread_attr_init(&small);
  pthread_attr_setstacksize(&small, 128 << 10);
  pthread_setattr_default_np(&small);
  constexpr int threads = 40;  // more than wait since other tests
  std::atomic<int> inside = 0;
  std::atomic<long> sum = 0;
  Workers(threads).for_each(threads, [&](std::size_t) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
    for (++inside; inside < threads && std::chrono::steady_clock::now() < until;) std::this_thread::yield();
    std::array<volatile char, 1 << 20> room;
    for (std::size_t i = 0; i < room.size(); i += 1024) room[i] = 1;
    sum += room[0];
  });
  CHECK(sum == threads);
  pthread_setattr_default_np(&before);
}
#endif
