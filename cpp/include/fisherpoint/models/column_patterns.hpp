// The columns of S of a model that is lists of operations, by their patterns: the states that a column reaches, and the
// products that its rates are sums of. Found once for a model, where a loop over sets of bits would find it anew in every
// stage.
#pragma once

#include <algorithm>
#include <vector>

#include "fisherpoint/models/variable_sets.hpp"

namespace fisherpoint {

// What columns that reach the same states have in common. Their rows are numbered without gaps.
struct ColumnPattern {
  // The product of an entry of f_x and a row of the column.
  struct Term {
    int entry, row;
  };

  std::vector<int> columns, states;
  std::vector<Term> terms;     // of the rate of row 0, of row 1, ...
  std::vector<int> terms_end;  // of every row's
  std::vector<int> drive;      // of every column and row: the entry of f_theta, or the zero behind all of them
};

// `start`: where the entries of a state's row of f_x begin; `drive_at(j, i)`: where that of f_theta is.
inline std::vector<ColumnPattern> column_patterns(const VariableSets& rows, const VariableSets& coupled, int columns,
                                                  const std::vector<int>& start, auto&& drive_at) {
  std::vector<ColumnPattern> patterns;
  for (int j = 0; j < columns; ++j) {
    std::vector<int> states;
    for_each_variable(rows[j], [&](int i) { states.push_back(i); });
    if (states.empty()) continue;
    const auto alike = std::find_if(patterns.begin(), patterns.end(), [&](const auto& of) { return of.states == states; });
    const bool known = alike != patterns.end();
    ColumnPattern& of = known ? *alike : patterns.emplace_back();
    of.columns.push_back(j);
    for (const int i : states) of.drive.push_back(drive_at(j, i));
    if (known) continue;
    of.states = states;
    for (const int i : states) {
      int entry = start[i];
      for_each_variable(coupled[i], [&](int k) {
        if (detail::has(rows[j], k)) of.terms.push_back({entry, detail::below(rows[j], k)});
        ++entry;
      });
      of.terms_end.push_back(static_cast<int>(of.terms.size()));
    }
  }
  return patterns;
}

}  // namespace fisherpoint
