// Blocks of memory that are quick to take and to drop: while a thread works it keeps those that it drops for the next of their
// size. Memory that comes from the system anew costs as much as what a short trajectory computes in it, so a thread keeps some
// of it from one work to the next.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <new>
#include <utility>
#include <vector>

namespace fisherpoint {

namespace detail {

// Of a block, in units of 64 bytes, and the shelf for blocks like it. Up to `exact` units each number has its own; beyond, four
// shelves serve from each power of two to the next, and blocks are as large as their shelf says.
struct BlockSize {
  static constexpr std::size_t unit = 64, exact = 512, shelves = exact + 4 * 9 + 1;

  std::size_t units, shelf;

  static constexpr BlockSize of(std::size_t bytes) {
    const std::size_t units = (bytes + unit - 1) / unit;
    if (units <= exact) return {units, units};
    const int step = std::bit_width(units - 1) - 3;  // of a quarter of a power of two
    const std::size_t quarters = ((units - 1) >> step) + 1;
    return {quarters << step, exact + 4 * (step - 7) + quarters - 4};
  }
  static constexpr BlockSize on(std::size_t shelf) {
    if (shelf <= exact) return {shelf, shelf};
    const std::size_t above = shelf - exact - 1;
    return {(above % 4 + 5) << (above / 4 + 7), shelf};
  }
};
static_assert([] {
  for (std::size_t units = 1; units <= 1 << 18; units += units < 2000 ? 1 : units / 7) {
    const auto size = BlockSize::of(units * BlockSize::unit);
    if (size.units < units || size.units > units + units / 4 || size.shelf >= BlockSize::shelves) return false;
    if (BlockSize::on(size.shelf).units != size.units) return false;
  }
  return true;
}());

}  // namespace detail

// A thread's work, in which blocks are kept; where it works already, a further object does nothing. Blocks that come from
// elsewhere may be kept, and those that are kept may be dropped when the work has ended: all are plain memory. Dropping takes
// no memory: free blocks are linked through themselves.
class Shelves {
 public:
  Shelves() : outermost_(!here_) {
    if (outermost_) here_ = &of_thread();
  }
  ~Shelves() {
    if (!outermost_) return;
    here_->clear(most_between);
    here_ = nullptr;
  }
  Shelves(const Shelves&) = delete;
  Shelves& operator=(const Shelves&) = delete;

  // A block for `bytes`, aligned for any pack. Throws std::bad_alloc. Not inlined, as drop: hot functions, into which
  // everything is, take many.
  [[gnu::noinline]] static void* take(std::size_t bytes) {
    const auto size = detail::BlockSize::of(bytes);
    if (here_ && size.shelf < here_->free.size() && here_->free[size.shelf]) {
      here_->kept -= size.units;
      return std::exchange(here_->free[size.shelf], here_->free[size.shelf]->next);
    }
    return ::operator new(size.units * alignment, std::align_val_t{alignment});
  }
  [[gnu::noinline]] static void drop(void* block, std::size_t bytes) noexcept {
    const auto size = detail::BlockSize::of(bytes);
    if (!here_ || size.shelf >= here_->free.size() || here_->kept + size.units > most_kept) return release(block);
    here_->kept += size.units;
    here_->free[size.shelf] = new (block) Block{here_->free[size.shelf]};
  }

 private:
  struct Block {
    Block* next;
  };
  static constexpr std::size_t alignment = detail::BlockSize::unit;
  static constexpr std::size_t most_kept = (16 << 20) / alignment, most_between = most_kept / 4;
  static void release(void* block) noexcept { ::operator delete(block, std::align_val_t{alignment}); }

  struct Kept {
    std::array<Block*, detail::BlockSize::shelves> free{};
    std::size_t kept = 0;  // units, on all shelves

    ~Kept() { clear(0); }
    // Gives back what is more than so many units, the largest blocks first.
    void clear(std::size_t most) {
      for (std::size_t shelf = free.size(); shelf-- > 0 && kept > most;)
        while (free[shelf] && kept > most) {
          kept -= detail::BlockSize::on(shelf).units;
          release(std::exchange(free[shelf], free[shelf]->next));
        }
    }
  };
  static Kept& of_thread() {
    static thread_local Kept kept;
    return kept;
  }
  static inline thread_local Kept* here_ = nullptr;
  bool outermost_;
};

// For a vector that is often made and dropped.
template <class T>
struct ShelfAllocator {
  using value_type = T;
  ShelfAllocator() = default;
  template <class S>
  ShelfAllocator(const ShelfAllocator<S>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(Shelves::take(n * sizeof(T))); }
  void deallocate(T* values, std::size_t n) noexcept { Shelves::drop(values, n * sizeof(T)); }
  template <class S>
  bool operator==(const ShelfAllocator<S>&) const {
    return true;
  }
};

template <class T>
using ShelfVector = std::vector<T, ShelfAllocator<T>>;

}  // namespace fisherpoint
