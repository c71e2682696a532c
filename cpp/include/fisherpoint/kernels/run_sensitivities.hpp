// States, outputs and sensitivities along a batch of runs: segment after segment, S carried on from one to the next.
//
// A piece of a run, its segments under the same input (runs.hpp), is an experiment point that starts at what the last one left
// (sensitivities.hpp). Pieces of several runs share a pack, whichever they are of each, where they take equally many steps: a
// run waits for others so that lanes are full. Nothing of a run depends on the others.
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
  MovedSwitches moved = {};
  bool doubts = false;  // entries of dx_dtheta that hang on whether a jump comes before a segment's end or behind it are NaN
};

// Some of the runs, which one thread takes along at a time: runs[first], runs[first + 1], ... up to runs[last - 1].
template <class M>
class RunTeam {
  // Of its lanes, in all steps, a pack has so many at work, or its pieces wait for others; but for no more than so many rounds.
  static constexpr double full = 0.9;
  static constexpr int longest_wait = 20;

 public:
  RunTeam(std::size_t first, std::size_t last) : first_(first), starting_(last - first) {
    std::iota(starting_.begin(), starting_.end(), std::size_t{0});
  }

  bool done() const { return starting_.empty() && waiting_.empty(); }

  // To the end, or for as long as a thread stays.
  template <class P, class Method>
  void advance(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
               const Tolerance& tolerance, const SensitiveRuns& out) {
    constexpr std::size_t width = lanes_of<P>::width;
    const auto shape = shape_of(model);
    const Shelves shelves;
    if (segment_.empty()) begin(shape, runs, start, parameters, out);
    const Points points{segment_.size(), x0_.data(), u_.data(), dt_.data()};
    const Parameters of_pieces{theta_.data(), true};
    const MovedStarts moved{start.moved.each, moved_by_.data(), rate_.data(), static_cast<std::size_t>(shape.jumps_end),
                            slid_.data()};
    const bool dense = DenseOutput::exists(method_of<Method>(tolerance));
    const PieceSamples samples{at_.data(), state_.data(), first_segment_.data(), start.measured, out.x,
                               out.y,      out.dx_dtheta, out.dy_dtheta,         missed_.data()};
    const Carried carried{s_.data(),    step_.data(), stiff_.data(), measured_.data(),
                          ends_.data(), came_.data(), moved,         &samples};
    const SensitiveTrajectories reached{x_.data(), y_.data(), s_after_.data(), dy_.data(), status_.data()};
    const auto leave = std::chrono::steady_clock::now() + stay;
    while (!done() && std::chrono::steady_clock::now() < leave) {
      const bool stepwise = !waiting_.empty() && waiting_.size() < width && paths_[waiting_[0]].stepwise;  // which fill up
      const std::size_t beginning = waiting_.empty() || stepwise ? starting_.size() : starting_.size() / width * width;
      std::vector<std::size_t> begun(starting_.begin(), starting_.begin() + beginning);
      starting_.erase(starting_.begin(), starting_.begin() + beginning);
      for (const std::size_t i : begun) begin_piece(shape, runs, start, i, dense, out);
      if (runs.updates) update<P>(model, points, of_pieces, begun, runs);
      std::erase_if(begun, [&](auto i) { return status_[i] != Status::ok && (waiting_.push_back(i), true); });
      if (moved.each > 0) come_to_switches<P, Method>(model, points, of_pieces, tolerance, begun, start.moved, runs.segments);
      in_packs<M, P>(Workers(1), begun, [&](auto rows) {
        find_paths<P, Method>(model, points, of_pieces, tolerance, rows, &carried, paths_, reached);
      });
      for (const std::size_t i : begun)
        if (at_[i].size() > 1 && paths_[i].size() > 0)
          missed_[i] = !samples_lie_between(shape, paths_[i], at_[i], next_to_jump * tolerance.relative * dt_[i]);
      waiting_.insert(waiting_.end(), begun.begin(), begun.end());
      end_pieces(shape, runs, start, out);  // that have failed
      if (goes_stepwise(shape, dependence_of(model))) {
        in_packs<M, P>(Workers(1), stepwise_packs(width), [&](auto rows) {
          follow_columns_stepwise<P, Method>(model, points, of_pieces, tolerance, rows, &carried, paths_, reached);
        });
        end_pieces(shape, runs, start, out);
      }
      in_packs<M, P>(Workers(1), full_packs(width), [&](auto rows) {
        follow_columns<P, Method>(model, points, of_pieces, tolerance, rows, &carried, paths_, reached);
      });
      end_pieces(shape, runs, start, out);
    }
  }

 private:
  void begin(const Shape<M>& shape, const Runs& runs, const RunStart& start, const Parameters& parameters,
             const SensitiveRuns& out) {
    const std::size_t count = starting_.size(), n = runs.segments, n_x = shape.states, n_y = shape.outputs,
                      p = shape.parameters;
    for (const auto& [numbers, each] : {std::pair{&x0_, n_x},
                                        {&came_, n_x},
                                        {&x_, n_x},
                                        {&y_, n_y},
                                        {&u_, std::size_t(shape.inputs)},
                                        {&theta_, p},
                                        {&dt_, 1ul},
                                        {&step_, 1ul},
                                        {&s_, n_x * p},
                                        {&s_after_, n_x * p},
                                        {&dy_, n_y * p}})
      numbers->assign(count * each, 0.0);
    if (start.s) std::copy_n(start.s + first_ * n_x * p, s_.size(), s_.data());
    segment_.assign(count, 0);
    first_segment_.assign(count, 0);
    state_.assign(count, 0);
    at_.resize(count);
    missed_.assign(count, 0);
    one_by_one_.assign(count, 0);
    begun_.resize(count);
    waited_.assign(count, 0);
    stiff_.assign(count, 0);
    measured_.assign(count, 0);
    status_.assign(count, Status::ok);
    end_.assign(count, SegmentEnd{});
    moved_by_.assign(count * start.moved.each, -1);
    rate_.assign(count * start.moved.each * n_x, 0.0);
    slid_.assign(count * start.moved.each * shape.jumps_end, 0);
    paths_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t k = first_ + i;
      ends_.push_back(&end_[i]);
      std::copy_n(parameters.of(k, shape.parameters), p, theta_.data() + i * p);
      std::copy_n(runs.x0 + k * n_x, n_x, out.x + k * (n + 1) * n_x);
      std::fill_n(out.y + k * n * n_y, n * n_y, 0.0);
      if (out.dx_dtheta) std::fill_n(out.dx_dtheta + k * n * n_x * p, n * n_x * p, 0.0);
      std::fill_n(out.dy_dtheta + k * n * n_y * p, n * n_y * p, 0.0);
      out.status[k] = Status::ok;
      out.reached[k] = 0;
    }
    std::erase_if(starting_, [&](auto i) { return !goes_on(shape, runs, i, out); });
  }

  // Whether run i has a next segment; behind the last one the state stays.
  bool goes_on(const Shape<M>& shape, const Runs& runs, std::size_t i, const SensitiveRuns& out) {
    const std::size_t k = first_ + i, n = runs.segments, n_x = shape.states;
    if (out.status[k] == Status::ok && segment_[i] < n && runs.dt_of(k, segment_[i]) > 0.0) return true;
    double* const x = out.x + k * (n + 1) * n_x;
    for (std::size_t ahead = segment_[i] + 1; ahead <= n; ++ahead) std::copy_n(x + segment_[i] * n_x, n_x, x + ahead * n_x);
    return false;
  }

  void begin_piece(const Shape<M>& shape, const Runs& runs, const RunStart& start, std::size_t i, bool dense,
                   const SensitiveRuns& out) {
    const std::size_t k = first_ + i, n = runs.segments, n_x = shape.states, n_u = shape.inputs;
    const bool alone = !dense || stiff_[i] || segment_[i] < one_by_one_[i];
    const auto separate = [&](std::size_t segment) {
      const std::int32_t* const by = start.moved.column + (k * n + segment) * start.moved.each;
      return alone || std::any_of(by, by + start.moved.each, [](std::int32_t j) { return j >= 0; });
    };
    find_piece(runs, k, segment_[i], n_u, separate, at_[i]);
    missed_[i] = false;
    first_segment_[i] = k * n + segment_[i];
    state_[i] = first_segment_[i] + k;
    if (at_[i].size() > 1) {
      const std::size_t entries = n_x * shape.parameters;
      begun_[i] = {step_[i], goes_on_from_ends(shape) ? end_[i] : SegmentEnd{}, {}};
      if (runs.updates_of(k, segment_[i])) begun_[i].s.assign(s_.begin() + i * entries, s_.begin() + (i + 1) * entries);
    }
    std::copy_n(out.x + (k * (n + 1) + segment_[i]) * n_x, n_x, x0_.data() + i * n_x);
    std::copy_n(x0_.data() + i * n_x, n_x, came_.data() + i * n_x);
    std::copy_n(runs.u_of(k, segment_[i], shape.inputs), n_u, u_.data() + i * n_u);
    dt_[i] = at_[i].back();
    measured_[i] = start.measured[first_segment_[i] + at_[i].size() - 1];
    waited_[i] = 0;
  }

  // x and S behind updates at the starts of pieces.
  template <class P>
  void update(const M& model, const Points& points, const Parameters& of_pieces, std::span<const std::size_t> begun,
              const Runs& runs) {
    if constexpr (has_resets<StateEquation<M, P>>) {
      const auto shape = shape_of(model);
      const std::size_t n_x = shape.states, p = shape.parameters;
      std::vector<std::size_t> updated;
      for (const std::size_t i : begun)
        if (runs.updates_of(first_ + i, segment_[i])) {
          updated.push_back(i);
          if (end_[i].doubtful) begin_in_doubt(shape, i);
        }
      in_packs<M, P>(Workers(1), updated, [&](auto rows) {
        const PointPack<M, P> pack(shape, points, of_pieces, rows);
        const VariationalEquation<M, P> equation(model, pack.theta, pack.u, pack.used);
        const auto& dependence = equation.dependence;
        auto x = pack.x0;
        P which(0.0);
        Columns<M, P> s(dependence.in_columns);
        const auto for_each_entry = [&](auto&& use) {
          for (int lane = 0; lane < pack.used; ++lane)
            for (std::size_t j = 0; j < p; ++j)
              for (std::size_t i = 0; i < n_x; ++i)
                if (dependence.depends(i, j))
                  use(lane, s[dependence.column_start[j] + detail::below(dependence.rows(j), i)],
                      s_[(rows[lane] * n_x + i) * p + j]);
        };
        for (P& entry : s) entry = P(0.0);
        for_each_entry([](int lane, P& entry, double& of_run) { lanes_of<P>::set(entry, lane, of_run); });
        for (int lane = 0; lane < pack.used; ++lane)
          lanes_of<P>::set(which, lane, runs.updates_of(first_ + rows[lane], segment_[rows[lane]]));
        equation.update(which, x, s);
        for_each_entry([](int lane, P& entry, double& of_run) { of_run = lanes_of<P>::get(entry, lane); });
        for (int lane = 0; lane < pack.used; ++lane) get_lane(x, lane, x0_.data() + rows[lane] * n_x);
      });
    }
  }

  // An update in the instant in which a jump is met: S behind it may hang on which comes first.
  void begin_in_doubt(const Shape<M>& shape, std::size_t i) {
    const std::size_t n_x = shape.states, n_y = shape.outputs;
    status_[i] = Status::on_jump;
    paths_[i] = PointPath<M>();
    std::copy_n(came_.data() + i * n_x, n_x, x_.data() + i * n_x);
    std::fill_n(y_.data() + i * n_y, n_y, 0.0);
  }

  // Into rate_: f at the starts of pieces, before switches there that parameters move.
  template <class P, class Method>
  void come_to_switches(const M& model, const Points& points, const Parameters& of_pieces, const Tolerance& tolerance,
                        std::span<const std::size_t> begun, const MovedSwitches& moved, std::size_t segments) {
    const std::size_t n_x = shape_of(model).states, n_u = shape_of(model).inputs;
    std::vector<double> before(u_);
    for (std::size_t e = 0; e < moved.each; ++e) {
      std::vector<std::size_t> switching;
      for (const std::size_t i : begun) {
        const std::size_t at = ((first_ + i) * segments + segment_[i]) * moved.each + e;
        moved_by_[i * moved.each + e] = moved.column[at];
        if (moved.column[at] < 0) continue;
        std::copy_n(moved.u + at * n_u, n_u, before.data() + i * n_u);
        switching.push_back(i);
      }
      const Points under{points.count, points.x0, before.data(), points.dt};
      in_packs<M, P>(Workers(1), switching, [&](auto rows) {
        rates_at_starts<P, Method>(model, under, of_pieces, tolerance, rows, ends_.data(), came_.data(), rate_.data() + e * n_x,
                                   slid_.data() + e * shape_of(model).jumps_end, moved.each);
      });
    }
  }

  void end_pieces(const Shape<M>& shape, const Runs& runs, const RunStart& start, const SensitiveRuns& out) {
    std::erase_if(waiting_, [&](auto i) {
      if (paths_[i].size() > 0 && !missed_[i]) return false;
      end_piece(shape, runs, start, i, out);
      return true;
    });
  }

  void end_piece(const Shape<M>& shape, const Runs& runs, const RunStart& start, std::size_t i, const SensitiveRuns& out) {
    const std::size_t k = first_ + i, n = runs.segments, inside = at_[i].size() - 1, at = first_segment_[i] + inside;
    const std::size_t n_x = shape.states, n_y = shape.outputs, n_u = shape.inputs, p = shape.parameters;
    if (inside > 0 && (missed_[i] || status_[i] != Status::ok)) return begin_one_by_one(shape, i, out);
    segment_[i] += inside + 1;
    std::copy_n(x_.data() + i * n_x, n_x, out.x + (k * (n + 1) + segment_[i]) * n_x);
    std::copy_n(y_.data() + i * n_y, n_y, out.y + at * n_y);
    out.status[k] = status_[i];
    if (status_[i] == Status::ok) {
      out.reached[k] += inside + 1;
      const std::span<const double> s(s_after_.data() + i * n_x * p, n_x * p);
      if (out.dx_dtheta) std::copy(s.begin(), s.end(), out.dx_dtheta + at * n_x * p);
      if (out.dx_dtheta && start.doubts && goes_on_from_ends(shape))
        mark_doubts(end_[i], std::span(out.dx_dtheta + at * n_x * p, n_x * p));
      std::copy_n(dy_.data() + i * n_y * p, n_y * p, out.dy_dtheta + at * n_y * p);
      std::copy(s.begin(), s.end(), s_.data() + i * n_x * p);
      if (goes_on_from_ends(shape)) end_[i].u.assign(u_.data() + i * n_u, u_.data() + (i + 1) * n_u);
    }
    if (goes_on(shape, runs, i, out)) starting_.push_back(i);
  }

  // The piece anew, segment by segment.
  void begin_one_by_one(const Shape<M>& shape, std::size_t i, const SensitiveRuns& out) {
    const std::size_t n_x = shape.states, n_y = shape.outputs, p = shape.parameters, at = first_segment_[i];
    const std::size_t inside = at_[i].size() - 1;
    std::fill_n(out.y + at * n_y, inside * n_y, 0.0);
    if (out.dx_dtheta) std::fill_n(out.dx_dtheta + at * n_x * p, inside * n_x * p, 0.0);
    std::fill_n(out.dy_dtheta + at * n_y * p, inside * n_y * p, 0.0);
    paths_[i] = PointPath<M>();
    status_[i] = Status::ok;
    step_[i] = begun_[i].step;
    stiff_[i] = false;
    end_[i] = begun_[i].end;
    std::copy(begun_[i].s.begin(), begun_[i].s.end(), s_.begin() + i * n_x * p);
    one_by_one_[i] = segment_[i] + inside + 1;
    starting_.push_back(i);
  }

  // Those of the waiting pieces that go step by step, whichever fill packs; a pack of less where no further one can begin.
  std::vector<std::size_t> stepwise_packs(std::size_t width) {
    std::vector<std::size_t> filling;
    for (const std::size_t i : waiting_)
      if (paths_[i].stepwise) filling.push_back(i);
    if (filling.size() >= width) filling.resize(filling.size() / width * width);
    return filling;
  }

  // Those of the other ones that fill packs, by the number of their steps.
  std::vector<std::size_t> full_packs(std::size_t width) {
    const auto last = std::partition(waiting_.begin(), waiting_.end(), [&](auto i) { return !paths_[i].stepwise; });
    const std::span whole(waiting_.begin(), last);
    std::stable_sort(whole.begin(), whole.end(), [&](auto a, auto b) { return paths_[a].size() < paths_[b].size(); });
    std::vector<std::size_t> filling;
    std::span<const std::size_t> fullest;
    double most = 0.0;
    for (std::size_t first = 0; first < whole.size(); first += width) {
      const auto pack = whole.subspan(first, std::min(width, whole.size() - first));
      std::size_t steps = 0;
      bool long_enough = false;
      for (const std::size_t i : pack) {
        steps += paths_[i].size();
        long_enough = ++waited_[i] > longest_wait || long_enough;
      }
      const double share = static_cast<double>(steps) / (width * paths_[pack.back()].size());
      if (share >= full || long_enough) filling.insert(filling.end(), pack.begin(), pack.end());
      if (share > most) fullest = pack, most = share;
    }
    if (filling.empty() && starting_.size() < width) filling.assign(fullest.begin(), fullest.end());
    return filling;
  }

  static void mark_doubts(const SegmentEnd& end, std::span<double> s) {
    if (!end.doubtful) return;
    for (std::size_t e = 0; e < s.size(); ++e)
      if (end.between || s[e] != end.other_s[e]) s[e] = std::numeric_limits<double>::quiet_NaN();
  }

  std::size_t first_;
  std::vector<std::size_t> starting_, waiting_;  // runs, from first_ on: for their next segment, and for S along it
  // Of every run: the segment, its point and its path, what it carries on, and for how many rounds it has waited for others.
  std::vector<std::size_t> segment_;
  // Of every piece: its first segment and its start among those of all runs, and when its segments end; whether its samples
  // must be ends of pieces, until which segment they are, and what it began with.
  struct Begun {
    double step;
    SegmentEnd end;
    std::vector<double> s;  // where updates change it
  };
  std::vector<std::size_t> first_segment_, state_, one_by_one_;
  std::vector<std::vector<double>> at_;
  std::vector<unsigned char> missed_;
  std::vector<Begun> begun_;
  std::vector<int> waited_;
  std::vector<double> x0_, came_, u_, theta_, dt_, s_, step_;
  std::vector<unsigned char> stiff_, measured_;
  std::vector<std::int32_t> moved_by_;
  std::vector<double> rate_;
  std::vector<unsigned char> slid_;
  std::vector<SegmentEnd> end_;
  std::vector<SegmentEnd*> ends_;
  std::vector<PointPath<M>> paths_;
  std::vector<double> x_, y_, s_after_, dy_;  // at the segment's end
  std::vector<Status> status_;
};

template <class P, class Method, class M>
void run_sensitivity_packs(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                           const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out) {
  constexpr std::size_t most = 1024, least = PacksOf<M, P>::vector;
  const auto threads = static_cast<std::size_t>(workers.threads());
  const std::size_t each = (runs.count + threads - 1) / threads, together = std::min(most, (each + least - 1) / least * least);
  std::vector<RunTeam<M>> teams;
  for (std::size_t first = 0; first < runs.count; first += together)
    teams.emplace_back(first, std::min(first + together, runs.count));
  workers.for_each_until_done(teams.size(), [&](std::size_t t) {
    teams[t].template advance<P, Method>(model, runs, start, parameters, tolerance, out);
    return teams[t].done();
  });
}

// Compiled once per model and instruction set (cpp/src/sensitivities.cpp).
template <class M>
void run_sensitivities(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                       const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out);

}  // namespace fisherpoint
