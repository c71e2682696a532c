#include <doctest/doctest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "fisherpoint/kernels/points.hpp"
#include "fisherpoint/kernels/workers.hpp"
#include "fisherpoint/models/tape.hpp"

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

TEST_CASE("every item is taken on until it is done, and no further") {
  for (int threads : {1, 2, 5})
    for (std::size_t items : {0, 1, 2, 40}) {
      std::vector<std::atomic<int>> pieces(items), inside(items);
      Workers(threads).for_each_until_done(items, [&](std::size_t i) {
        CHECK(++inside[i] == 1);
        std::this_thread::yield();
        --inside[i];
        return ++pieces[i] == 1 + static_cast<int>(i) % 7;
      });
      for (std::size_t i = 0; i < items; ++i) CHECK(pieces[i] == 1 + static_cast<int>(i) % 7);
    }
}

TEST_CASE("an interrupt stops items that are done at once, however many they are") {
  for (int threads : {1, 2}) {
    std::atomic<int> done = 0;
    const Workers workers(threads, [] { return true; });
    CHECK_THROWS_AS(workers.for_each_until_done(1 << 20,
                                                [&](std::size_t) {
                                                  std::this_thread::sleep_for(std::chrono::milliseconds(1));
                                                  return ++done > 0;
                                                }),
                    Interrupted);
    CHECK(done < 10000);
  }
}

TEST_CASE("an interrupt stops items that take long, also those that another thread has alone") {
  for (int threads : {1, 2}) {
    std::atomic<bool> elsewhere = false;
    std::atomic<int> checks = 0;
    const Workers workers(threads, [&] { return ++checks >= 2; });
    const auto caller = std::this_thread::get_id();
    const auto started = std::chrono::steady_clock::now();
    CHECK_THROWS_AS(workers.for_each_until_done(2,
                                                [&](std::size_t) {
                                                  std::this_thread::sleep_for(std::chrono::milliseconds(1));
                                                  if (std::this_thread::get_id() != caller) elsewhere = true;
                                                  return elsewhere && std::this_thread::get_id() == caller;
                                                }),
                    Interrupted);
    CHECK(std::chrono::steady_clock::now() - started < std::chrono::seconds(5));
  }
}

TEST_CASE("an exception ends items that take long") {
  for (int threads : {1, 3}) {
    std::array<std::atomic<int>, 3> pieces{};
    CHECK_THROWS_AS(Workers(threads).for_each_until_done(pieces.size(),
                                                         [&](std::size_t i) {
                                                           if (++pieces[i] == 3 && i == 2) throw std::runtime_error("no");
                                                           return pieces[i] == 1000;
                                                         }),
                    std::runtime_error);
    CHECK(pieces[2] == 3);
  }
}

TEST_CASE("packs have every point once, in order, and are full but for those of the end") {
  using P = Pack<4 * native_lanes>;
  constexpr std::size_t width = P::width, vector = PacksOf<TapeModel, P>::vector;
  static_assert(vector == native_lanes);
  for (std::size_t threads : {1, 2, 3})
    for (std::size_t points = 0; points <= 7 * width + 1; ++points) {
      std::vector<std::size_t> order(points), found;
      std::iota(order.begin(), order.end(), std::size_t{0});
      const PacksOf<TapeModel, P> packs(order, static_cast<int>(threads));
      std::size_t small = 0;
      for (std::size_t pack = packs.size(); pack-- > 0;) {
        found.insert(found.end(), packs[pack].begin(), packs[pack].end());
        CHECK(packs[pack].size() > 0);
        CHECK(packs[pack].size() <= width);
        small += packs[pack].size() < width;
      }
      CHECK(found == order);
      CHECK(small <= threads * width / 2 / vector);
      if (points <= threads * vector) CHECK(packs.size() == (points + vector - 1) / vector);  // each thread has some
    }
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
