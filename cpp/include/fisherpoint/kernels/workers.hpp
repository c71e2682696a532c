// Threads over numbered items. Who works on which item is left to chance; results must be written to the item's own place and
// reduced in item order afterwards, so that they are the same to the last bit for any number of threads.
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

struct Interrupted : std::exception {
  const char* what() const noexcept override { return "interrupted"; }
};

// Address space that is kept free for a thread to begin with: one that finds no memory for its own variables ends the process.
class Room {
 public:
  Room() : at_(mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {
    if (at_ == MAP_FAILED) throw std::bad_alloc();
  }
  ~Room() { munmap(at_, size); }
  Room(const Room&) = delete;
  Room& operator=(const Room&) = delete;

 private:
  static constexpr std::size_t size = 1 << 20;
  void* at_;
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
      const std::size_t wanted = items > 1 && threads_ > 1 ? std::min(std::size_t(threads_), items) - 1 : 0;
      try {
        for (std::size_t i = 0; i < wanted; ++i)
          others.emplace_back([&drain, room = std::make_unique<Room>()]() mutable {
            room.reset();
            drain({});
          });
      } catch (const std::system_error&) {
      } catch (const std::bad_alloc&) {
      }
      drain(interrupted_);
    }
    if (failure) std::rethrow_exception(failure);
  }

 private:
  int threads_;
  std::function<bool()> interrupted_;
};

}  // namespace fisherpoint
