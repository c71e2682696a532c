// States, outputs and sensitivities along a batch of runs: segment after segment, S carried on from one to the next.
//
// A segment of all runs is a batch of experiment points that start at what the last one left (sensitivities.hpp), so that runs
// with equally many steps share a pack. Nothing of a run depends on the others.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "fisherpoint/kernels/runs.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"

namespace fisherpoint {

struct SensitiveRuns {
  double *x, *y;                  // (count, segments + 1, n_x), (count, segments, n_y) at the segments' ends
  double *dx_dtheta, *dy_dtheta;  // (count, segments, n_x, p) or none, (count, segments, n_y, p); zero where it is not ok
  Status* status;                 // (count,)
  std::int64_t* reached;          // (count,), segments that were completed
};

// What a run starts with, and what of it is asked for.
struct RunStart {
  const double* s;                // (count, n_x, p), dx/dtheta; none for zero
  const unsigned char* measured;  // (count, segments), at which ends a derivative must exist
  bool doubts = false;  // entries of dx_dtheta that hang on whether a jump comes before a segment's end or behind it are NaN
};

// Some of the runs, which one thread takes along at a time. Sensitivities are those of runs[first], runs[first + 1], ...
class RunTeam {
 public:
  RunTeam(std::size_t first, std::size_t last) : active_(last - first), first_(first) {
    std::iota(active_.begin(), active_.end(), first);
  }

  bool done() const { return active_.empty(); }

  // To the end, or for as long as a thread stays.
  template <class P, class Method, class M>
  void advance(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
               const Tolerance& tolerance, const SensitiveRuns& out) {
    const auto shape = shape_of(model);
    const std::size_t n_x = shape.states, n_y = shape.outputs, n_u = shape.inputs, p = shape.parameters, n = runs.segments;
    if (segment_ == 0) begin(runs, start, n_x, n_y, p, out);
    const auto leave = std::chrono::steady_clock::now() + stay;
    for (; !active_.empty() && std::chrono::steady_clock::now() < leave; ++segment_) {
      std::erase_if(active_, [&](auto k) { return segment_ == n || runs.dt_of(k, segment_) == 0.0; });
      const std::size_t count = active_.size();
      if (count == 0) return;
      resize(count, n_x, n_y, n_u, p);
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t k = active_[i];
        std::copy_n(out.x + (k * (n + 1) + segment_) * n_x, n_x, &x0_[i * n_x]);
        std::copy_n(runs.u_of(k, segment_, shape.inputs), n_u, u_.data() + i * n_u);
        std::copy_n(parameters.of(k, shape.parameters), p, theta_.data() + i * p);
        std::copy_n(s_.data() + (k - first_) * n_x * p, n_x * p, s_before_.data() + i * n_x * p);
        dt_[i] = runs.dt_of(k, segment_);
        step_[i] = step_of_[k - first_];
        stiff_[i] = stiff_of_[k - first_];
        measured_[i] = start.measured[k * n + segment_];
        if (goes_on_from_ends(shape)) ends_[i] = &end_of_[k - first_];
      }
      const Carried carried{s_before_.data(), step_.data(), stiff_.data(), measured_.data(), ends_.data()};
      sensitivity_packs<P, Method>(model, Points{count, x0_.data(), u_.data(), dt_.data()}, Parameters{theta_.data(), true},
                                   tolerance, Workers(1), {x_.data(), y_.data(), s_after_.data(), dy_.data(), status_.data()},
                                   &carried);
      for (std::size_t i = 0; i < count; ++i) {
        const std::size_t k = active_[i], at = k * n + segment_;
        for (std::size_t ahead = segment_ + 1; ahead <= n; ++ahead)  // behind the last segment the state stays
          std::copy_n(&x_[i * n_x], n_x, out.x + (k * (n + 1) + ahead) * n_x);
        std::copy_n(&y_[i * n_y], n_y, out.y + at * n_y);
        out.status[k] = status_[i];
        if (status_[i] != Status::ok) continue;
        ++out.reached[k];
        if (out.dx_dtheta) std::copy_n(s_after_.data() + i * n_x * p, n_x * p, out.dx_dtheta + at * n_x * p);
        if (out.dx_dtheta && start.doubts && goes_on_from_ends(shape))
          mark_doubts(end_of_[k - first_], std::span(out.dx_dtheta + at * n_x * p, n_x * p));
        std::copy_n(dy_.data() + i * n_y * p, n_y * p, out.dy_dtheta + at * n_y * p);
        std::copy_n(s_after_.data() + i * n_x * p, n_x * p, s_.data() + (k - first_) * n_x * p);
        step_of_[k - first_] = step_[i];
        stiff_of_[k - first_] = stiff_[i];
        if (goes_on_from_ends(shape)) end_of_[k - first_].u.assign(u_.data() + i * n_u, u_.data() + (i + 1) * n_u);
      }
      std::erase_if(active_, [&](auto k) { return out.status[k] != Status::ok; });
    }
  }

 private:
  void begin(const Runs& runs, const RunStart& start, std::size_t n_x, std::size_t n_y, std::size_t p,
             const SensitiveRuns& out) {
    const std::size_t n = runs.segments;
    for (const std::size_t k : active_) {
      for (std::size_t segment = 0; segment <= n; ++segment)
        std::copy_n(runs.x0 + k * n_x, n_x, out.x + (k * (n + 1) + segment) * n_x);
      std::fill_n(out.y + k * n * n_y, n * n_y, 0.0);
      if (out.dx_dtheta) std::fill_n(out.dx_dtheta + k * n * n_x * p, n * n_x * p, 0.0);
      std::fill_n(out.dy_dtheta + k * n * n_y * p, n * n_y * p, 0.0);
      out.status[k] = Status::ok;
      out.reached[k] = 0;
    }
    s_.assign(active_.size() * n_x * p, 0.0);
    if (start.s) std::copy_n(start.s + first_ * n_x * p, s_.size(), s_.data());
    step_of_.assign(active_.size(), 0.0);
    end_of_.assign(active_.size(), SegmentEnd{});
    stiff_of_.assign(active_.size(), 0);
  }

  static void mark_doubts(const SegmentEnd& end, std::span<double> s) {
    if (!end.doubtful) return;
    for (std::size_t e = 0; e < s.size(); ++e)
      if (end.between || s[e] != end.other_s[e]) s[e] = std::numeric_limits<double>::quiet_NaN();
  }

  void resize(std::size_t count, std::size_t n_x, std::size_t n_y, std::size_t n_u, std::size_t p) {
    for (const auto& [numbers, each] : {std::pair{&x0_, n_x},
                                        {&x_, n_x},
                                        {&y_, n_y},
                                        {&u_, n_u},
                                        {&theta_, p},
                                        {&dt_, 1ul},
                                        {&step_, 1ul},
                                        {&s_before_, n_x * p},
                                        {&s_after_, n_x * p},
                                        {&dy_, n_y * p}})
      numbers->resize(count * each);
    stiff_.resize(count);
    ends_.resize(count);
    measured_.resize(count);
    status_.resize(count);
  }

  std::vector<std::size_t> active_;  // runs that go on
  std::size_t first_, segment_ = 0;
  // Of all runs of the team, at the start of the segment.
  std::vector<double> s_, step_of_;
  std::vector<unsigned char> stiff_of_;
  std::vector<SegmentEnd> end_of_;
  // Of the active ones, at its start and end.
  std::vector<double> x0_, u_, theta_, dt_, step_, s_before_, x_, y_, s_after_, dy_;
  std::vector<unsigned char> stiff_, measured_;
  std::vector<SegmentEnd*> ends_;
  std::vector<Status> status_;
};

template <class P, class Method, class M>
void run_sensitivity_packs(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                           const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out) {
  constexpr std::size_t width = lanes_of<P>::width, most = 1024;
  const std::size_t packs = (runs.count + width - 1) / width, threads = static_cast<std::size_t>(workers.threads());
  const std::size_t together = std::clamp((packs + threads - 1) / threads * width, width, std::max(width, most));
  std::vector<RunTeam> teams;
  for (std::size_t first = 0; first < runs.count; first += together)
    teams.emplace_back(first, std::min(first + together, runs.count));
  while (std::erase_if(teams, [](const RunTeam& team) { return team.done(); }), !teams.empty()) {
    if (workers.interrupted()) throw Interrupted{};
    workers.for_each(teams.size(), [&](std::size_t t) {
      teams[t].template advance<P, Method>(model, runs, start, parameters, tolerance, out);
    });
  }
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <class M>
void run_sensitivities(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                       const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out);

}  // namespace fisherpoint
