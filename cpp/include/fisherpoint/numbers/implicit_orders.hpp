// In which order the unknowns of an implicit step's systems are eliminated: those of its states, and those of all stages of a
// column. Of small models, and where no order takes far fewer operations than a full matrix does, there is none.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "fisherpoint/numbers/elimination_order.hpp"

namespace fisherpoint {

class ImplicitOrders {
 public:
  static constexpr int least_states = 12, stages = 3;

  // Of a model of so many states, whose f_x has these entries.
  ImplicitOrders(int states, const std::vector<std::pair<int, int>>& entries) {
    if (states < least_states) return;
    const auto at = [&](int stage, int i) { return stage * states + i; };
    std::vector<std::pair<int, int>> of_stages;
    for (int r = 0; r < stages; ++r) {
      for (const auto& [i, k] : entries) of_stages.emplace_back(at(r, i), at(r, k));
      for (int q = 0; q < stages; ++q)
        for (int i = 0; i < states; ++i) of_stages.emplace_back(at(r, i), at(q, i));
    }
    states_ = order_that_pays(states, entries);
    stages_ = order_that_pays(stages * states, of_stages);
  }

  const EliminationOrder* of_states() const { return states_ ? &*states_ : nullptr; }
  const EliminationOrder* of_stages() const { return stages_ ? &*stages_ : nullptr; }

 private:
  static std::optional<EliminationOrder> order_that_pays(int n, const std::vector<std::pair<int, int>>& entries) {
    std::optional<EliminationOrder> order(std::in_place, n, entries);
    if (!order->pays()) return std::nullopt;
    order->find_targets();
    return order;
  }

  std::optional<EliminationOrder> states_, stages_;
};

}  // namespace fisherpoint
