// Plans the steps for all trajectories of one experiment point over the nodes of a prior.
//
// The kinks that do not depend on theta are met at the same times by all of them: the nominal trajectory tells where. Between
// them, the number of equal steps is the smallest with which pilots, spread over the edge of the nodes, reach the tolerance;
// their errors are seen from solutions with smaller steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "fisherpoint/integration/integrator.hpp"
#include "fisherpoint/integration/replay.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/prior/pilots.hpp"

namespace fisherpoint {

template <class M>
struct Plan {
  std::vector<Stretch<M>> stretches;
  double largest_squared_error;                       // embedded; what is above it is not believed
  typename ArraysOf<M, double>::Outputs nominal_y{};  // by the plan's own steps
  std::vector<double> shared{};                       // stage by stage, the states that do not depend on theta (replay.hpp)

  template <class P>
  mask_of_lanes<P> believed(const Replayed<P>& replayed) const {
    return (replayed.clearance > P(0.0)) & (replayed.squared_error <= P(largest_squared_error));
  }
};

template <class M, class P, class Method>
class Planner {
  using Equation = StateEquation<M, P>;
  static constexpr int width = lanes_of<P>::width, most_steps = 256;
  // Embedded errors of nodes may be so many times the pilots' largest.
  static constexpr double slack = 4.0;
  static constexpr std::size_t many_nodes = 2000;

  struct Ends {
    std::vector<typename ArraysOf<M, double>::States> x;
    std::vector<bool> clear;
    std::vector<double> squared_error;
  };

 public:
  // `pilots` must outlive the planner.
  Planner(const M& model, const double* x0, const double* u, const Pilots& pilots)
      : model_(model), shape_(shape_of(model)), pilots_(pilots) {
    fit(x0_, shape_.states);
    fit(u_, shape_.inputs);
    set_lanes(x0_, x0);
    set_lanes(u_, u);
  }

  // `nominal`: the steps of the nominal trajectory, in lane 0. None where too many pilots are no trajectories, or no number of
  // steps is enough: then every node is for the adaptive loop.
  std::optional<Plan<M>> plan(const Steps<Equation>& nominal, const Tolerance& tolerance) const {
    const double rtol = tolerance.relative;
    std::vector<Stretch<M>> stretches = between_kinks(nominal);
    if (stretches.empty()) return std::nullopt;

    // As many steps as the nominal trajectory took, then twice as many, until that changes nothing any more.
    Ends end = ends(stretches, tolerance), finer = end;
    double error = std::numeric_limits<double>::infinity(), last_error = error;
    while (true) {
      if (total_steps(stretches) > most_steps) return std::nullopt;
      std::vector<Stretch<M>> doubled = stretches;
      for (auto& stretch : doubled) stretch.steps *= 2;
      finer = ends(doubled, tolerance);
      last_error = error;
      error = difference(end, finer);
      if (error <= rtol) break;
      stretches = doubled;
      end = finer;
    }
    if (total_steps(stretches) > static_cast<int>(stretches.size())) {
      // The last two tries tell the order, and with it the longest step that may do; equal steps in all stretches are fewer.
      const double order = std::isfinite(last_error) ? std::clamp(std::log2(last_error / error), 4.0, 12.0) : 6.0;
      double longest = 0, whole = 0;
      for (const auto& stretch : stretches) {
        longest = std::max(longest, stretch.duration / stretch.steps);
        whole = std::max(whole, stretch.duration);
      }
      std::vector<Stretch<M>> last;
      for (double step = std::min(longest * std::pow(rtol / error, 1 / order), whole); step > longest; step *= 0.92) {
        const std::vector<Stretch<M>> tried = divided(stretches, step);
        if (same_steps(tried, last)) continue;
        last = tried;
        if (total_steps(tried) >= total_steps(stretches)) break;
        const Ends reached = ends(tried, tolerance);
        if (difference(reached, finer) > rtol) continue;
        stretches = tried;
        end = reached;
        break;
      }
    }
    // One step less in one stretch or the other pays where there are many nodes to take it.
    for (std::size_t k = 0; pilots_.nodes > many_nodes && k < stretches.size(); ++k) {
      std::vector<Stretch<M>> fewer = stretches;
      if (--fewer[k].steps == 0) continue;
      const Ends reached = ends(fewer, tolerance);
      if (difference(reached, finer) > rtol) continue;
      stretches = fewer;
      end = reached;
    }
    if (!end.clear[0] || !finer.clear[0]) return std::nullopt;
    // Only pilots that were compared tell what to believe: another may have passed a pole, with any estimate. What is estimated
    // below the tolerance is believed in any case: the estimate is of a lower order.
    double largest = rtol * rtol;
    for (int k = 0; k < pilots_.count; ++k)
      if (finer.clear[k]) largest = std::max(largest, slack * slack * end.squared_error[k]);
    Plan<M> plan{stretches, largest};
    const StateEquation<M, double> equation(model_, of_row(pilots_[0], shape_.parameters), of_lane(u_, shape_.inputs));
    plan.nominal_y = equation.output(end.x[0]);
    auto x = of_lane(x0_, shape_.states);
    replay<Method>(equation, tolerance, x, plan.stretches, Recorded{plan.shared});
    return plan;
  }

 private:
  // One stretch for every run of steps on the same sides; none where the time of a kink or jump on the way depends on theta, or
  // where it is stiff.
  std::vector<Stretch<M>> between_kinks(const Steps<Equation>& steps) const {
    std::vector<Stretch<M>> stretches;
    for (const auto& step : steps) {
      const double size = lanes_of<P>::get(step.size, 0);
      if (size == 0.0) continue;
      if (lanes_of<P>::get(step.implicit, 0)) return {};
      const auto side = of_lane(step.side, shape_.sides);
      if (any_slides<double>(shape_, side)) return {};  // how long, depends on theta
      if (stretches.empty() || stretches.back().side != side) {
        bool fixed = true;
        for_each_index(shape_.sides, [&](auto m) {
          const bool turned = !stretches.empty() && stretches.back().side[m] != side[m];
          if (turned && !planned(shape_, dependence_of(model_), m)) fixed = false;
        });
        if (!fixed) return {};
        stretches.push_back({0.0, 0, side});
      }
      stretches.back().duration += size;
      ++stretches.back().steps;
    }
    return stretches;
  }

  // The stretches with steps of at most `step`.
  static std::vector<Stretch<M>> divided(std::vector<Stretch<M>> stretches, double step) {
    for (auto& stretch : stretches) stretch.steps = std::max(1, static_cast<int>(std::ceil(stretch.duration / step - 1e-6)));
    return stretches;
  }
  static int total_steps(const std::vector<Stretch<M>>& stretches) {
    int total = 0;
    for (const auto& stretch : stretches) total += stretch.steps;
    return total;
  }
  static bool same_steps(const std::vector<Stretch<M>>& a, const std::vector<Stretch<M>>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& s, const auto& t) { return s.steps == t.steps; });
  }

  Ends ends(const std::vector<Stretch<M>>& stretches, const Tolerance& tolerance) const {
    Ends result;
    typename Equation::Theta theta;
    fit(theta, shape_.parameters);
    for (int first = 0; first < pilots_.count; first += width) {
      for (int lane = 0; lane < width; ++lane) set_lane(theta, lane, pilots_[std::min(first + lane, pilots_.count - 1)]);
      const Equation equation(model_, theta, u_);
      auto x = x0_;
      const auto replayed = replay<Method>(equation, tolerance, x, stretches);
      for (int lane = 0; lane < width && first + lane < pilots_.count; ++lane) {
        result.x.push_back(of_lane(x, shape_.states, lane));
        result.clear.push_back(lanes_of<P>::get(replayed.clear(), lane));
        result.squared_error.push_back(lanes_of<P>::get(replayed.squared_error, lane));
      }
    }
    return result;
  }

  // The largest difference between two solutions of the pilots that are clear in the finer one, in units of the states'
  // scales; infinite where these are few.
  double difference(const Ends& coarse, const Ends& fine) const {
    double largest = 0;
    int compared = 0;
    for (int k = 0; k < pilots_.count; ++k) {
      if (!fine.clear[k]) continue;
      ++compared;
      if (!coarse.clear[k]) return std::numeric_limits<double>::infinity();
      for_each_index(shape_.states, [&](auto i) {
        largest = std::max(largest, std::abs(coarse.x[k][i] - fine.x[k][i]) * inverse_scale(model_, i));
      });
    }
    return compared < pilots_.count / 4 ? std::numeric_limits<double>::infinity() : largest;
  }

  const M& model_;
  decltype(shape_of(std::declval<const M&>())) shape_;
  typename Equation::State x0_;
  typename Equation::Input u_;
  const Pilots& pilots_;
};

}  // namespace fisherpoint
