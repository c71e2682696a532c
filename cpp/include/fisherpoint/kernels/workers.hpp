// Threads over numbered items. Who works on which item is left to chance; results must be written to the item's own place and
// reduced in item order afterwards, so that they are the same to the last bit for any number of threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "fisherpoint/kernels/thread_pool.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

class Workers {
 public:
  // `interrupted` is asked about ten times a second, on the calling thread only; true ends the work with Interrupted.
  explicit Workers(
      int threads, std::function<bool()> interrupted = [] { return false; })
      : threads_(threads), interrupted_(std::move(interrupted)) {}

  int threads() const { return threads_; }
  bool interrupted() const { return interrupted_(); }

  // work(item) for every item in [0, items), on the calling thread and threads - 1 others, or as many as the system lets start.
  // An item should take well under a tenth of a second. The first exception stops the work and is thrown again here.
  void for_each(std::size_t items, const std::function<void(std::size_t)>& work) const {
    std::atomic<std::size_t> next{0};
    std::atomic<bool> stop{false};
    std::exception_ptr failure;
    std::mutex failing;
    const auto drain = [&](const std::function<bool()>& asked) {
      const Shelves shelves;
      [[maybe_unused]] const volatile int none = std::uncaught_exceptions();  // makes what a first exception would make
      try {
        auto last_asked = std::chrono::steady_clock::now();
        while (!stop.load(std::memory_order_relaxed)) {
          const std::size_t item = next.fetch_add(1, std::memory_order_relaxed);
          if (item >= items) return;
          work(item);
          if (!asked) continue;
          const auto now = std::chrono::steady_clock::now();
          if (now - last_asked < between_checks) continue;
          last_asked = now;
          if (asked()) throw Interrupted{};
        }
      } catch (...) {
        const std::lock_guard lock(failing);
        if (!failure) failure = std::current_exception();
        stop = true;
      }
    };
    const std::size_t others = std::min(std::size_t(std::max(threads_, 1)), std::max<std::size_t>(items, 1)) - 1;
    if (others == 0) {
      drain(interrupted_);
    } else {
      const auto work_of_all = std::make_shared<SharedWork>([&drain] { drain({}); });
      ThreadPool::here().offer(work_of_all, others);
      drain(interrupted_);
      ThreadPool::here().withdraw(work_of_all);
    }
    if (failure) std::rethrow_exception(failure);
  }

  // advance(item) again and again, for every item in [0, items), until it returns that the item is done: what takes long, piece
  // by piece. A thread stays with its item, and waits for no other; a piece should take well under a tenth of a second.
  void for_each_until_done(std::size_t items, const std::function<bool(std::size_t)>& advance) const {
    const std::thread::id caller = std::this_thread::get_id();
    std::atomic<std::size_t> next{0}, left{items};
    std::atomic<bool> stop{false};
    std::mutex waiting;
    std::condition_variable changed;
    const auto go_through = [&] {
      const bool calling = std::this_thread::get_id() == caller;
      auto checked = std::chrono::steady_clock::now();
      for (std::size_t item = next++; item < items; item = next++) {
        for (bool done = false; !done;) {
          if (stop) return;
          done = advance(item);
          if (!calling || std::chrono::steady_clock::now() - checked < between_checks) continue;
          checked = std::chrono::steady_clock::now();
          if (interrupted()) throw Interrupted{};
        }
        const std::lock_guard lock(waiting);
        if (--left == 0) changed.notify_one();
      }
      if (!calling) return;
      const auto ended = [&] { return left == 0 || stop; };
      look_for_a_while(ended);
      for (std::unique_lock lock(waiting); !ended();)
        if (!changed.wait_for(lock, between_checks, ended) && interrupted()) throw Interrupted{};
    };
    for_each(std::min(static_cast<std::size_t>(std::max(threads_, 1)), items), [&](std::size_t) {
      try {
        go_through();
      } catch (...) {
        stop = true;
        changed.notify_one();
        throw;
      }
    });
  }

 private:
  static constexpr std::chrono::milliseconds between_checks{100};

  int threads_;
  std::function<bool()> interrupted_;
};

}  // namespace fisherpoint
