// An explicit method whose numbers are read when it runs: one code for both methods, of models whose loops over stages are not
// unrolled in any case. The numbers are what runge_kutta.hpp says of a method's constants.
#pragma once

#include <algorithm>
#include <array>

#include "fisherpoint/integration/dormand_prince.hpp"
#include "fisherpoint/integration/dormand_prince_853.hpp"

namespace fisherpoint {

struct Tableau {
  static constexpr int most_stages = DormandPrince853::stages, most_in_error = DormandPrince853::in_error;

  int order, stages, in_error;
  double most_growth, allowed_estimate, allowed_of_rows, stability, beside_kink;
  std::array<std::array<double, most_stages - 1>, most_stages> a{};
  std::array<std::array<double, most_in_error + 2>, most_in_error> behind{};
  std::array<bool, most_stages> begun_before{};  // whether the sum for stage s - 1 begins that for stage s; of every other one

  template <class Method>
  constexpr explicit Tableau(const Method& method)
      : order(method.order),
        stages(method.stages),
        in_error(method.in_error),
        most_growth(method.most_growth),
        allowed_estimate(method.allowed_estimate),
        allowed_of_rows(method.allowed_of_rows),
        stability(method.stability),
        beside_kink(method.beside_kink) {
    for (int s = 0; s < stages; ++s) std::copy(method.a[s].begin(), method.a[s].end(), a[s].begin());
    for (int s = 0; s < in_error; ++s) std::copy(method.behind[s].begin(), method.behind[s].end(), behind[s].begin());
    for (int s = stages - 2; s > 0; s -= 2) begun_before[s] = begins(s - 1, s);
  }

  // What decides a step's error and end is the methods' own, to the last bit.
  auto end_of(const auto& stage, int i) const { return is_54() ? Of54::end_of(stage, i) : Of853::end_of(stage, i); }
  auto error_of(const auto& stage, int i) const { return is_54() ? Of54::error_of(stage, i) : Of853::error_of(stage, i); }
  auto coarse_of(const auto& stage, int i) const { return is_54() ? Of54::coarse_of(stage, i) : Of853::coarse_of(stage, i); }
  auto bow_of(const auto& stage, int i) const { return is_54() ? Of54::bow_of(stage, i) : Of853::bow_of(stage, i); }
  template <class P>
  P squared_error(const P& embedded, const P& by_coarse) const {
    return is_54() ? DormandPrince::squared_error(embedded, by_coarse) : DormandPrince853::squared_error(embedded, by_coarse);
  }
  template <class P>
  P inverse_root(const P& squared_error) const {
    return is_54() ? DormandPrince::inverse_root(squared_error) : DormandPrince853::inverse_root(squared_error);
  }

 private:
  using Of54 = StageSums<DormandPrince, false>;
  using Of853 = StageSums<DormandPrince853, false>;

  // Whether both have weights for the same stages before s - 1. Only beyond two does that save more readings than the sum in
  // between costs, which is written and read.
  constexpr bool begins(int before, int s) const {
    int terms = 0;
    for (int r = 0; r < before; ++r) {
      if ((a[s][r] != 0) != (a[before][r] != 0)) return false;
      terms += a[s][r] != 0;
    }
    return terms > 2;
  }
  constexpr bool is_54() const { return order == DormandPrince::order; }
};

}  // namespace fisherpoint
