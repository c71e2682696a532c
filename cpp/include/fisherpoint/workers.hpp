// Threads over numbered items. Who works on which item is left to chance; results must be written to the item's own place and
// reduced in item order afterwards, so that they are the same to the last bit for any number of threads.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

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

  // work(item) for every item in [0, items), on the calling thread and threads - 1 others. An item should take well under a
  // tenth of a second. The first exception stops the work and is thrown again here.
  void for_each(std::size_t items, const std::function<void(std::size_t)>& work) const {
    std::atomic<std::size_t> next{0};
    std::atomic<bool> stop{false};
    std::exception_ptr failure;
    std::mutex failing;
    const auto drain = [&](const std::function<bool()>& asked) {
      try {
        auto last_asked = std::chrono::steady_clock::now();
        while (!stop.load(std::memory_order_relaxed)) {
          const std::size_t item = next.fetch_add(1, std::memory_order_relaxed);
          if (item >= items) return;
          work(item);
          if (!asked) continue;
          const auto now = std::chrono::steady_clock::now();
          if (now - last_asked < std::chrono::milliseconds(100)) continue;
          last_asked = now;
          if (asked()) throw Interrupted{};
        }
      } catch (...) {
        const std::lock_guard lock(failing);
        if (!failure) failure = std::current_exception();
        stop = true;
      }
    };
    {
      std::vector<std::jthread> others;
      const std::size_t wanted = threads_ > 1 ? std::size_t(threads_) - 1 : 0;
      for (std::size_t i = 0; i < wanted && i + 1 < items; ++i) others.emplace_back([&] { drain({}); });
      drain(interrupted_);
    }
    if (failure) std::rethrow_exception(failure);
  }

 private:
  int threads_;
  std::function<bool()> interrupted_;
};

}  // namespace fisherpoint
