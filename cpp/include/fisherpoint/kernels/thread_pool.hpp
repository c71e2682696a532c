// Threads that are kept between calls and wait for work. To start one costs as much as a dozen trajectories, and on a busy
// machine it may be milliseconds until it runs: so nobody waits for a thread that has not begun.
#pragma once

#include <pthread.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>

#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

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

// Looks for a while whether something has come about, before one sleeps until it has: to be put to sleep and woken takes as
// long as a dozen trajectories, and what follows within one call of a kernel mostly comes sooner. Others may run in the
// meantime.
template <class Asked>
void look_for_a_while(const Asked& asked) {
  constexpr std::chrono::microseconds while_looked(100);
  const auto until = std::chrono::steady_clock::now() + while_looked;
  do {
    for (int turn = 0; turn < 20; ++turn) {
      if (asked()) return;
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
    std::this_thread::yield();
  } while (std::chrono::steady_clock::now() < until);
}

// What several threads do together. Who comes while it is open takes part; to close it waits for those who do.
class SharedWork {
 public:
  explicit SharedWork(std::function<void()> part) : part_(std::move(part)) {}

  void take_part() {
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return;
      ++inside_;
    }
    part_();
    const std::lock_guard lock(mutex_);
    if (--inside_ == 0) left_.notify_all();
  }
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    look_for_a_while([&] { return inside_ == 0; });
    std::unique_lock lock(mutex_);
    left_.wait(lock, [&] { return inside_ == 0; });
  }

 private:
  std::function<void()> part_;  // throws nothing
  std::mutex mutex_;
  std::condition_variable left_;
  std::atomic<int> inside_ = 0;  // changed by who has the mutex
  bool closed_ = false;
};

class ThreadPool {
 public:
  // The one of this process, which lasts as long as it does: threads that wait need not be ended. A fork has none of them, and
  // begins with another one.
  static ThreadPool& here() {
    static const int forks [[maybe_unused]] = pthread_atfork(nullptr, nullptr, [] { current_ = nullptr; });
    if (ThreadPool* const pool = current_.load()) return *pool;
    auto made = std::make_unique<ThreadPool>();
    ThreadPool* expected = nullptr;
    return *(current_.compare_exchange_strong(expected, made.get()) ? made.release() : expected);
  }

  // Asks so many threads to take part, which are started where too few wait, or as many as the system lets start.
  void offer(const std::shared_ptr<SharedWork>& work, std::size_t threads) {
    {
      const std::lock_guard lock(mutex_);
      offers_.insert(offers_.end(), threads, work);
      open_ = offers_.size();
      try {
        for (; waiting_ < offers_.size(); ++waiting_) start();
      } catch (const std::system_error&) {
      } catch (const std::bad_alloc&) {
      }
    }
    threads == 1 ? offered_.notify_one() : offered_.notify_all();
  }
  // No thread begins with it any more, and none that has is left.
  void withdraw(const std::shared_ptr<SharedWork>& work) {
    {
      const std::lock_guard lock(mutex_);
      std::erase(offers_, work);
      open_ = offers_.size();
    }
    work->close();
  }

 private:
  // With a stack of our choice: musl's is 128 kB otherwise, which the kernels of a model of equations just about fill.
  static void start() {
    auto room = std::make_unique<Room>();
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    pthread_attr_setstacksize(&attributes, stack_size);
    const auto begin = [](void* kept) -> void* { here().run(std::unique_ptr<Room>(static_cast<Room*>(kept))); };
    pthread_t thread;
    const int failure = pthread_create(&thread, &attributes, begin, room.get());
    pthread_attr_destroy(&attributes);
    if (failure != 0) throw std::system_error(failure, std::generic_category());
    room.release();  // which the thread has
  }
  [[noreturn]] void run(std::unique_ptr<Room> room) {
    room.reset();
    {
      const Shelves shelves;                                                  // makes what is this thread's own
      [[maybe_unused]] const volatile int none = std::uncaught_exceptions();  // and what a first exception would make
    }
    for (;;) {
      std::shared_ptr<SharedWork> work;
      {
        std::unique_lock lock(mutex_);
        offered_.wait(lock, [&] { return !offers_.empty(); });
        work = std::move(offers_.front());
        offers_.pop_front();
        open_ = offers_.size();
        --waiting_;
      }
      work->take_part();
      work.reset();
      {
        const std::lock_guard lock(mutex_);
        ++waiting_;
      }
      look_for_a_while([&] { return open_ > 0; });
    }
  }

  static constexpr std::size_t stack_size = 2 << 20;
  static inline std::atomic<ThreadPool*> current_ = nullptr;
  std::mutex mutex_;
  std::condition_variable offered_;
  std::deque<std::shared_ptr<SharedWork>> offers_;
  std::atomic<std::size_t> open_ = 0;  // as many offers as there are
  std::size_t waiting_ = 0;            // threads, with those that have not begun yet
};

}  // namespace fisherpoint
