// What carries rows back over a step (adjoints.hpp), of a model that is lists of operations: its patterns and a method's
// weights as flat lists, made once. Sums stay in registers, and where one part of the packs is in use, that alone is computed.
#pragma once

#include <vector>

#include "fisherpoint/models/dependence.hpp"
#include "fisherpoint/numbers/parts.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

template <class P>
class RowLists {
 public:
  // Its states are those that depend on a parameter; of others that these read there is nothing to carry back.
  template <class Equation>
  RowLists(const Equation& f, const auto& method) : stages_(method.in_error) {
    std::vector<int> number(f.states, -1);
    for_each_variable(f.dependence.sensitive(), [&](auto i) {
      number[i] = static_cast<int>(states_.size());
      states_.push_back(i);
    });
    std::vector<std::vector<Term>> by_state(states_.size());
    for (const int i : states_) {
      const auto coupled = f.dependence.coupled(i);
      for_each_variable(coupled, [&](auto k) {
        const int entry = f.dependence.state_start[i] + detail::below(coupled, k);
        if (number[k] >= 0) by_state[number[k]].push_back({number[i], f.dependence.kept_at(entry)});
      });
    }
    for (const auto& terms : by_state) of_states_.add(terms);
    for (int j = 0; j < f.parameters; ++j) {
      std::vector<Term> terms;
      const auto driven = f.dependence.driven(j);
      for_each_variable(driven, [&](auto i) {
        const int entry = f.dependence.by_state + f.dependence.theta_start[j] + detail::below(driven, i);
        terms.push_back({number[i], f.dependence.kept_at(entry)});
      });
      of_parameters_.add(terms);
    }
    for (int s = 0; s < stages_; ++s) {
      std::vector<Weight> weights;
      for (int r = s + 1; r < stages_ + 2; ++r)
        if (method.behind[s][r] != 0) weights.push_back({method.behind[s][r], r});
      weights_.add(weights);
    }
    nu_.resize((stages_ + 2) * states_.size());
    mu_.resize(states_.size());
  }

  // Of a step, whose stages' Jacobians have `changing` entries each, from `entries` on, and these constant ones: from the last
  // of `stages` to the first. Of the row of the error `sum` is what all rows have in lambda.
  template <class Q>
  void carry_back(int stages, const P& step, const P* entries, int changing, const P* constants, const P* sum, P* lambda,
                  P* gradient) {
    const int count = static_cast<int>(states_.size());
    for (int m = 0; m < count; ++m) {
      if (stages < stages_) nu_[stages * count + m] = P(0.0);
      nu_[stages_ * count + m] = lambda[states_[m]];
      nu_[(stages_ + 1) * count + m] = sum ? sum[states_[m]] : P(0.0);
    }
    for (int s = stages; s-- > 0;) {
      for (int m = 0; m < count; ++m) {
        Q total(0.0);
        for (const Weight& of : weights_[s]) total = fused(Q(of.weight), read_as<Q>(nu_[of.stage * count + m]), total);
        write_as(mu_[m], Q(read_as<Q>(step) * total));
      }
      const P* const stage = entries + s * changing;
      const auto add = [&](const auto& terms, Q total) {
        for (const Term& of : terms) {
          const P& entry = of.place < 0 ? constants[~of.place] : stage[of.place];
          total = fused(read_as<Q>(entry), read_as<Q>(mu_[of.from]), total);
        }
        return total;
      };
      for (int m = 0; m < count; ++m) {
        const Q total = add(of_states_[m], Q(0.0));
        write_as(nu_[s * count + m], total);
        P& own = lambda[states_[m]];
        write_as(own, Q(read_as<Q>(own) + total));
      }
      for (int j = 0; j < of_parameters_.size(); ++j) write_as(gradient[j], add(of_parameters_[j], read_as<Q>(gradient[j])));
    }
  }

 private:
  // An entry of a Jacobian times mu of a state: kept at this place, or as the constant ~place.
  struct Term {
    int from, place;
  };
  struct Weight {
    double weight;
    int stage;
  };
  // Lists, one behind the other.
  template <class Item>
  class Lists {
   public:
    void add(const std::vector<Item>& items) {
      items_.insert(items_.end(), items.begin(), items.end());
      ends_.push_back(items_.size());
    }
    int size() const { return static_cast<int>(ends_.size()) - 1; }
    struct List {
      const Item *first, *last;
      const Item* begin() const { return first; }
      const Item* end() const { return last; }
    };
    List operator[](int k) const { return {items_.data() + ends_[k], items_.data() + ends_[k + 1]}; }

   private:
    std::vector<Item> items_;
    std::vector<std::size_t> ends_{0};
  };

  int stages_;
  std::vector<int> states_;
  Lists<Term> of_states_, of_parameters_;
  Lists<Weight> weights_;  // of every stage: of those behind it, then of lambda, and of all rows' lambda
  ShelfVector<P> nu_, mu_;
};

}  // namespace fisherpoint
