// Sets of any number of variables, as bits of words: those of a tape, whose numbers are known at run time alone.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fisherpoint {

// One of a list of sets, which owns the words.
struct VariableSet {
  const std::uint64_t* words;
  int count;  // of words
};

// What is in both of two sets of one list, or of lists with as many variables.
struct SharedVariables {
  VariableSet a, b;
};

inline SharedVariables both(VariableSet a, VariableSet b) { return {a, b}; }

// f(k) for every k in a set, from the smallest on.
inline void for_each_variable(VariableSet set, auto&& f) {
  for (int w = 0; w < set.count; ++w)
    for (std::uint64_t word = set.words[w]; word; word &= word - 1) f(64 * w + std::countr_zero(word));
}
inline void for_each_variable(SharedVariables sets, auto&& f) {
  for (int w = 0; w < sets.a.count; ++w)
    for (std::uint64_t word = sets.a.words[w] & sets.b.words[w]; word; word &= word - 1) f(64 * w + std::countr_zero(word));
}

// A list of sets of variables below one number.
class VariableSets {
 public:
  VariableSets(int sets, int variables)
      : each_((variables + 63) / 64), words_(static_cast<std::size_t>(sets) * static_cast<std::size_t>(each_), 0) {}

  VariableSet operator[](int set) const { return {words_.data() + first(set), each_}; }
  void add(int set, int k) { words_[first(set) + k / 64] |= std::uint64_t{1} << (k % 64); }
  // Adds what another set of the list has. Returns whether that was more.
  bool join(int set, int other) {
    bool more = false;
    for (int w = 0; w < each_; ++w) {
      std::uint64_t& word = words_[first(set) + w];
      const std::uint64_t joined = word | words_[first(other) + w];
      more = more || joined != word;
      word = joined;
    }
    return more;
  }

 private:
  std::size_t first(int set) const { return static_cast<std::size_t>(set) * each_; }

  int each_;
  std::vector<std::uint64_t> words_;
};

namespace detail {

inline bool has(VariableSet set, int i) { return (set.words[i / 64] >> (i % 64)) & 1; }

// How many of a set are below i.
inline int below(VariableSet set, int i) {
  int sum = 0, w = 0;
  for (; w < i / 64; ++w) sum += std::popcount(set.words[w]);
  return i % 64 == 0 ? sum : sum + std::popcount(set.words[w] & ((std::uint64_t{1} << (i % 64)) - 1));
}
inline int size_of(VariableSet set) { return below(set, 64 * set.count); }

}  // namespace detail

}  // namespace fisherpoint
