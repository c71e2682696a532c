// Blocks of memory that are quick to take and to drop: while a thread works it keeps those that it drops for the next of their
// size, of large ones one at a time for the next that is no larger. Beyond its work it keeps none.
#pragma once

#include <array>
#include <cstddef>
#include <new>
#include <utility>
#include <vector>

namespace fisherpoint {

// The shelves of this thread, from the object's making to its end; where there are some, a further object does nothing. Blocks
// that come from elsewhere may be put on them, and theirs may be dropped when they are gone: all are plain memory. Dropping
// takes no memory: free blocks are linked through themselves.
class Shelves {
 public:
  Shelves() {
    if (!here_) here_ = this;
  }
  ~Shelves() {
    if (here_ != this) return;
    here_ = nullptr;
    for (Block* block : free_)
      while (block) release(std::exchange(block, block->next));
    release(large_);
  }
  Shelves(const Shelves&) = delete;
  Shelves& operator=(const Shelves&) = delete;

  // A block for `bytes`, aligned for any pack. Throws std::bad_alloc. Not inlined, as drop: hot functions, into which
  // everything is, take many.
  [[gnu::noinline]] static void* take(std::size_t bytes) {
    const std::size_t units = units_of(bytes);
    if (here_ && units >= sizes && units <= here_->large_units_) {
      here_->large_units_ = 0;
      return std::exchange(here_->large_, nullptr);
    }
    if (here_ && units < sizes && here_->free_[units]) {
      here_->kept_ -= units;
      return std::exchange(here_->free_[units], here_->free_[units]->next);
    }
    return ::operator new(units * unit, std::align_val_t{unit});
  }
  [[gnu::noinline]] static void drop(void* block, std::size_t bytes) noexcept {
    const std::size_t units = units_of(bytes);
    if (here_ && units >= sizes && units <= most_kept && !here_->large_) {
      here_->large_units_ = units;
      here_->large_ = block;
      return;
    }
    if (!here_ || units >= sizes || here_->kept_ + units > most_kept) return release(block);
    here_->kept_ += units;
    here_->free_[units] = new (block) Block{here_->free_[units]};
  }

 private:
  struct Block {
    Block* next;
  };
  static constexpr std::size_t unit = 64, sizes = 512, most_kept = (16 << 20) / unit;
  static constexpr std::size_t units_of(std::size_t bytes) { return (bytes + unit - 1) / unit; }
  static void release(void* block) noexcept { ::operator delete(block, std::align_val_t{unit}); }

  static inline thread_local Shelves* here_ = nullptr;
  std::array<Block*, sizes> free_{};  // by units
  std::size_t kept_ = 0;              // units, on all shelves
  void* large_ = nullptr;             // of more units than these shelves have
  std::size_t large_units_ = 0;
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
