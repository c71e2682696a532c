// Arrays whose size is known at run time only, as light as std::array to make and to drop: a thread keeps the memory of what it
// dropped for the next array of that size.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "unroll.hpp"

namespace fisherpoint {

// n numbers on the heap, not set to anything at first.
template <class T>
class HeapArray {
 public:
  HeapArray() = default;
  explicit HeapArray(int n) : size_(n), values_(taken(n)) {}
  HeapArray(const HeapArray& other) : HeapArray(other.size_) { std::copy(other.begin(), other.end(), begin()); }
  HeapArray(HeapArray&& other) noexcept : size_(std::exchange(other.size_, 0)), values_(std::move(other.values_)) {}
  HeapArray& operator=(const HeapArray& other) {
    if (size_ != other.size_) *this = HeapArray(other.size_);
    std::copy(other.begin(), other.end(), begin());
    return *this;
  }
  HeapArray& operator=(HeapArray&& other) noexcept {
    std::swap(size_, other.size_);
    std::swap(values_, other.values_);
    return *this;
  }
  ~HeapArray() {
    if (values_) drop(std::move(values_), size_);
  }

  std::size_t size() const { return size_; }
  T* data() { return values_.get(); }
  const T* data() const { return values_.get(); }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  T& operator[](int i) { return values_[i]; }
  const T& operator[](int i) const { return values_[i]; }
  void fill(const T& value) { std::fill(begin(), end(), value); }
  friend bool operator==(const HeapArray& a, const HeapArray& b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

 private:
  using Shelf = std::vector<std::unique_ptr<T[]>>;
  struct Shelves {
    std::vector<Shelf> of_size;
    ~Shelves() { gone = true; }
    static inline thread_local bool gone = false;  // at the end of a thread, other things of it may be dropped later
  };

  // What this thread has dropped of size n. Not inlined: hot functions, into which everything is, take many arrays.
  static Shelf& shelf(int n) {
    static thread_local Shelves shelves;
    if (static_cast<int>(shelves.of_size.size()) <= n) shelves.of_size.resize(n + 1);
    return shelves.of_size[n];
  }
  [[gnu::noinline]] static void drop(std::unique_ptr<T[]> values, int n) {
    if (!Shelves::gone) shelf(n).push_back(std::move(values));
  }
  [[gnu::noinline]] static std::unique_ptr<T[]> taken(int n) {
    if (n == 0) return nullptr;
    if (Shelves::gone) return std::unique_ptr<T[]>(new T[n]);
    Shelf& free = shelf(n);
    if (free.empty()) return std::unique_ptr<T[]>(new T[n]);
    std::unique_ptr<T[]> values = std::move(free.back());
    free.pop_back();
    return values;
  }

  int size_ = 0;
  std::unique_ptr<T[]> values_;
};

}  // namespace fisherpoint
