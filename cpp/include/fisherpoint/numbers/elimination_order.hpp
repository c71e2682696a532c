// In which order the unknowns of a system of linear equations are eliminated, so that few entries are added to those that its
// matrix has: by least degree, on the pattern of A + A^T (A. George, J. W. H. Liu, "Computer solution of large sparse positive
// definite systems", 1981, section 5.3); of several such the one that no elimination has changed for longest, so that a
// processor need not wait for the one before: a band is eliminated from both its ends. Known once for all matrices of a
// pattern.
#pragma once

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace fisherpoint {

class EliminationOrder {
 public:
  // One unknown, which `row` of the matrix was, with `others` behind it in the order, beside the diagonal in its row and
  // column.
  struct Pivot {
    int row;
    int first;   // where its numbers are: the diagonal, then its row, then its column
    int others;  // how many
    int at;      // where they are in `behind` and `rows`
    int target;  // where what they make of each other is in `targets`
  };

  // Of a matrix (n, n) with these entries and its diagonal.
  EliminationOrder(int n, const std::vector<std::pair<int, int>>& entries) : place_(n) {
    std::vector<std::set<int>> beside(n);
    for (const auto& [i, k] : entries)
      if (i != k) beside[i].insert(k), beside[k].insert(i);
    std::vector<std::vector<int>> others;
    std::vector<bool> done(n, false);
    int in_all = 0;
    std::vector<int> reached(n, 0);  // when an elimination last changed its row
    for (int at = 0; at < n; ++at) {
      int least = -1;
      for (int i = 0; i < n; ++i)
        if (!done[i] &&
            (least < 0 || std::pair(beside[i].size(), reached[i]) < std::pair(beside[least].size(), reached[least])))
          least = i;
      done[least] = true;
      place_[least] = at;
      others.emplace_back(beside[least].begin(), beside[least].end());
      const int m = static_cast<int>(others.back().size());
      pivots.push_back({least, numbers, m, in_all, 0});
      in_all += m;
      numbers += 1 + 2 * m;
      operations += static_cast<double>(m) * (m + 1);
      for (const int i : others.back()) {
        beside[i].erase(least);
        reached[i] = at + 1;
        for (const int k : others.back())
          if (i != k) beside[i].insert(k);
      }
    }
    for (auto& of : others) {
      for (int& row : of) row = place_[row];
      std::sort(of.begin(), of.end());
      for (const int place : of) behind.push_back(place), rows.push_back(pivots[place].row);
    }
  }

  // Where the numbers are to be subtracted, which takes as much memory as there are operations.
  void find_targets() {
    for (Pivot& pivot : pivots) {
      pivot.target = static_cast<int>(targets.size());
      for (int i = 0; i < pivot.others; ++i)
        for (int k = 0; k < pivot.others; ++k) targets.push_back(number_at(behind[pivot.at + i], behind[pivot.at + k]));
    }
  }

  int size() const { return static_cast<int>(pivots.size()); }
  // Where the entry of this row and column is among the numbers.
  int number(int row, int column) const { return number_at(place_[row], place_[column]); }
  // Behind the last place in the order that a pivot changes.
  int end_of(const Pivot& pivot) const {
    return 1 + (pivot.others > 0 ? behind[pivot.at + pivot.others - 1] : static_cast<int>(&pivot - pivots.data()));
  }
  // Whether elimination in this order takes far fewer operations than of a full matrix.
  bool pays() const {
    const double n = size();
    return operations < 0.5 * (n * n * n / 3);
  }

  std::vector<Pivot> pivots;  // in order
  std::vector<int> behind;    // of every pivot, the others' places in the order
  std::vector<int> rows;      // and the rows of the matrix that they were
  std::vector<int> targets;   // of every pivot's column times its row, column by row: where that is subtracted
  int numbers = 0;            // the entries of the matrix, and those that are added
  double operations = 0;      // multiplications of a factorisation

 private:
  int number_at(int i, int k) const {
    if (i == k) return pivots[i].first;
    const Pivot& pivot = pivots[std::min(i, k)];
    const auto first = behind.begin() + pivot.at;
    const int rank = static_cast<int>(std::lower_bound(first, first + pivot.others, std::max(i, k)) - first);
    return pivot.first + 1 + rank + (i < k ? 0 : pivot.others);
  }

  std::vector<int> place_;  // of every row
};

}  // namespace fisherpoint
