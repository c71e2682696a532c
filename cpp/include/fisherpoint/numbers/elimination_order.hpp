// In which order the unknowns of a system of linear equations are eliminated, so that few entries are added to those that its
// matrix has: by least degree, on the pattern of A + A^T (A. George, J. W. H. Liu, "Computer solution of large sparse positive
// definite systems", 1981, section 5.3). Known once for all matrices of a pattern.
#pragma once

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

namespace fisherpoint {

class EliminationOrder {
 public:
  // One unknown, which `row` of the matrix was; entries beside the diagonal in its row and its column, behind it in the order.
  struct Pivot {
    int row;
    int first;                 // where its numbers are: the diagonal, then its row, then its column
    std::vector<int> behind;   // places in the order of the others
    std::vector<int> rows;     // of the matrix, which they were
    std::vector<int> targets;  // of its column times its row, column by row: where that is subtracted
  };

  // Of a matrix (n, n) with these entries and its diagonal.
  EliminationOrder(int n, const std::vector<std::pair<int, int>>& entries) : place_(n) {
    std::vector<std::set<int>> beside(n);
    for (const auto& [i, k] : entries)
      if (i != k) beside[i].insert(k), beside[k].insert(i);
    std::vector<std::vector<int>> behind;
    std::vector<bool> done(n, false);
    for (int at = 0; at < n; ++at) {
      int least = -1;
      for (int i = 0; i < n; ++i)
        if (!done[i] && (least < 0 || beside[i].size() < beside[least].size())) least = i;
      done[least] = true;
      place_[least] = at;
      pivots.push_back({least, numbers, {}, {}, {}});
      behind.emplace_back(beside[least].begin(), beside[least].end());
      const std::size_t m = behind.back().size();
      numbers += 1 + 2 * static_cast<int>(m);
      operations += static_cast<double>(m * (m + 1));
      for (const int i : behind.back()) {
        beside[i].erase(least);
        for (const int k : behind.back())
          if (i != k) beside[i].insert(k);
      }
    }
    for (int at = 0; at < n; ++at) {
      for (const int row : behind[at]) pivots[at].behind.push_back(place_[row]);
      std::sort(pivots[at].behind.begin(), pivots[at].behind.end());
      for (const int place : pivots[at].behind) pivots[at].rows.push_back(pivots[place].row);
    }
  }

  // Where the numbers are to be subtracted, which takes as much memory as there are operations.
  void find_targets() {
    for (Pivot& pivot : pivots)
      for (const int i : pivot.behind)
        for (const int k : pivot.behind) pivot.targets.push_back(number_at(i, k));
  }

  int size() const { return static_cast<int>(pivots.size()); }
  // Where the entry of this row and column is among the numbers.
  int number(int row, int column) const { return number_at(place_[row], place_[column]); }
  // Whether elimination in this order takes far fewer operations than of a full matrix.
  bool pays() const {
    const double n = size();
    return operations < 0.5 * (n * n * n / 3);
  }

  std::vector<Pivot> pivots;  // in order
  int numbers = 0;            // the entries of the matrix, and those that are added
  double operations = 0;      // multiplications of a factorisation

 private:
  int number_at(int i, int k) const {
    if (i == k) return pivots[i].first;
    const Pivot& pivot = pivots[std::min(i, k)];
    const auto found = std::lower_bound(pivot.behind.begin(), pivot.behind.end(), std::max(i, k));
    const int rank = static_cast<int>(found - pivot.behind.begin());
    return pivot.first + 1 + rank + (i < k ? 0 : static_cast<int>(pivot.behind.size()));
  }

  std::vector<int> place_;  // of every row
};

}  // namespace fisherpoint
