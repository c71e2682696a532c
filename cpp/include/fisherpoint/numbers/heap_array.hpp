// Arrays whose size is known at run time only, nearly as light as std::array to make and to drop (shelves.hpp).
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// n numbers on the heap, not set to anything at first.
template <class T>
class HeapArray {
 public:
  HeapArray() = default;
  explicit HeapArray(int n) : size_(n), values_(n ? static_cast<T*>(Shelves::take(n * sizeof(T))) : nullptr) {
    static_assert(std::is_trivially_default_constructible_v<T> && std::is_trivially_destructible_v<T>);
  }
  HeapArray(const HeapArray& other) : HeapArray(other.size_) { std::copy(other.begin(), other.end(), begin()); }
  HeapArray(HeapArray&& other) noexcept
      : size_(std::exchange(other.size_, 0)), values_(std::exchange(other.values_, nullptr)) {}
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
    if (values_) Shelves::drop(values_, size_ * sizeof(T));
  }

  std::size_t size() const { return size_; }
  T* data() { return values_; }
  const T* data() const { return values_; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  T& operator[](int i) { return values_[i]; }
  const T& operator[](int i) const { return values_[i]; }
  void fill(const T& value) { std::fill(begin(), end(), value); }
  friend bool operator==(const HeapArray& a, const HeapArray& b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

 private:
  int size_ = 0;
  T* values_ = nullptr;
};

}  // namespace fisherpoint
