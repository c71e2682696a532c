#include <doctest/doctest.h>

#include <atomic>
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
