// The steps of trajectories, which the states alone have taken, for sensitivities to follow: made finer, and walked along with
// a path in every lane.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "fisherpoint/models/shape.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// A run of one step onto a surface where f_x has no bounds, or off it, which S takes in its own way (steep_tangents.hpp).
enum class Steep : char { no, towards, away };
// States that are set anew at once, by the numbers of the resets as bits, where jump `surface` is met; by a change of the input
// it is -1.
struct ResetAt {
  double which;
  int surface;
};

// The steps that a point takes; none where nothing is to be done any more.
template <class M>
struct PointPath {
  struct Run {  // of steps of one kind on the same sides
    std::size_t end;
    typename ArraysOf<M, double>::Sides side;
    bool implicit;
    Steep steep = Steep::no;
    std::size_t first_reset = 0, resets_end = 0;  // at its start
    double instant = 0.0;                         // a surface that holds it from there on may do so as much earlier
  };
  std::vector<double> sizes;
  std::vector<Run> runs;
  std::vector<ResetAt> resets;
  // The sides from which the trajectory comes, and to which S belongs at its start. Where it ends as near to a jump as the
  // tolerance can tell: the sides on which it is if the end comes on the other side of that instant, or `between` where it
  // grazes one then, or turns twice.
  typename ArraysOf<M, double>::Sides start, other;
  bool ends_on_jump = false, between = false;
  std::vector<int> starts_on;  // kinks where f_x has no bounds, on which it starts
  bool starts_at_limit = false;
  double fineness = 1.0;  // of the steps beside these
  // Whether steps are divided only where S needs it (stepwise_columns.hpp); then how many it has taken, and what it is there.
  bool stepwise = false;
  std::size_t taken = 0;
  std::vector<double> halfway;

  std::size_t size() const { return sizes.size(); }
  // Whether f_x has no bounds where it starts.
  bool starts_steep() const { return starts_at_limit || !starts_on.empty(); }
  PointPath without_steps() const {
    PointPath none;
    none.start = start, none.other = other, none.ends_on_jump = ends_on_jump, none.between = between;
    none.starts_on = starts_on, none.starts_at_limit = starts_at_limit, none.fineness = fineness;
    none.resets = resets;
    return none;
  }
  // With the resets before the step that the runs do not have yet.
  void push_back(double size, const typename ArraysOf<M, double>::Sides& side, bool implicit, Steep steep = Steep::no,
                 std::size_t resets_end = 0) {
    const std::size_t known = runs.empty() ? 0 : runs.back().resets_end;
    if (runs.empty() || runs.back().side != side || runs.back().implicit != implicit || runs.back().steep != Steep::no ||
        steep != Steep::no || resets_end > known)
      runs.push_back({0, side, implicit, steep, known, std::max(known, resets_end)});
    sizes.push_back(size);
    runs.back().end = sizes.size();
  }
};

// Whether it crosses a jump, slides on one, or ends next to one.
template <class M>
bool meets_jump(const auto& shape, const PointPath<M>& path) {
  for (const auto& run : path.runs)
    for (int m = 0; m < shape.holds_end; ++m)
      if (run.side[m] == 0.0 || (m < shape.jumps_end && run.side[m] != path.start[m])) return true;
  return path.ends_on_jump || !path.resets.empty();
}

// The path on which surfaces hold the trajectory as soon as the tolerance does not see its distance to them. Several surfaces
// that begin to hold it one shortly after the other do so together.
template <class M>
PointPath<M> held_at_once(const auto& shape, PointPath<M> path) {
  for (std::size_t r = path.runs.size(); r-- > 1;) {
    const auto held = path.runs[r];
    double before = 0.0;
    for (std::size_t q = r; held.instant > 0.0 && q-- > 1 && path.runs[q].resets_end == held.resets_end;) {
      auto& run = path.runs[q];
      bool other = false;
      for (int m = 0; m < shape.sides; ++m)
        other = other || (run.side[m] != held.side[m] && (m < shape.jumps_end || m >= shape.holds_end || held.side[m] != 0.0));
      for (std::size_t n = path.runs[q - 1].end; n < run.end; ++n) before += path.sizes[n];
      if (other || before > held.instant) break;
      run.side = held.side, run.implicit = held.implicit;
    }
  }
  return path;
}

// The same path, of which the steps before and behind a surface where f_x has no bounds are one each: by so much as the
// trajectory may meet it at another time, its own steps would be out of place. They are as long as half of the longest step on
// that side.
template <class M>
PointPath<M> with_steep_steps(const auto& shape, const auto& dependence, const PointPath<M>& path) {
  // On the sides of `run`; what is held on a surface neither comes to it nor leaves it.
  const auto meets = [&](const auto& run, const auto& other) {
    bool found = false;
    for_each_index(Count<0>{}, shape.kinks_end,
                   [&](auto m) { found = found || (dependence.steep(m) && run[m] != other[m] && run[m] != 0.0); });
    return found;
  };
  const auto is_held = [&](const auto& run, const auto& other) {
    bool found = false;
    for (int m = shape.jumps_end; m < shape.holds_end; ++m) found = found || (run[m] != 0.0 && other[m] == 0.0);
    return found;
  };
  PointPath<M> marked = path.without_steps();
  std::size_t first = 0;
  for (std::size_t r = 0; r < path.runs.size(); ++r) {
    const auto& run = path.runs[r];
    // States that are set anew come to other sides without meeting the surface.
    const auto set_anew = [](const auto& at) { return at.resets_end > at.first_reset; };
    // Implicit steps that begin where the root balances what drives the trajectory go on from there.
    const bool away =
        !set_anew(run) && (r > 0 ? (!run.implicit || path.runs[r - 1].implicit) && meets(run.side, path.runs[r - 1].side)
                                 : !run.implicit && path.starts_steep());
    const bool towards = r + 1 < path.runs.size() && !set_anew(path.runs[r + 1]) && meets(run.side, path.runs[r + 1].side) &&
                         (!run.implicit || path.runs[r + 1].implicit || is_held(run.side, path.runs[r + 1].side));
    double longest = 0.0, whole = 0.0;
    for (std::size_t n = first; n < run.end; ++n) longest = std::max(longest, path.sizes[n]), whole += path.sizes[n];
    const double least = std::min(0.5 * longest, 0.4 * whole);
    std::size_t begin = first, end = run.end;
    double behind = 0.0, before = 0.0;
    if (away)
      while (begin < end && behind < least) behind += path.sizes[begin++];
    if (towards)
      while (end > begin && before < least) before += path.sizes[--end];
    if (towards && before < least) behind -= least - before, before = least;
    if (away) marked.push_back(behind, run.side, run.implicit, Steep::away, run.resets_end);
    for (std::size_t n = begin; n < end; ++n)
      marked.push_back(path.sizes[n], run.side, run.implicit, Steep::no, run.resets_end);
    if (towards) marked.push_back(before, run.side, run.implicit, Steep::towards, run.resets_end);
    first = run.end;
  }
  return marked;
}

// Whether any of its steps are such.
template <class M>
bool meets_steep(const PointPath<M>& path) {
  return std::any_of(path.runs.begin(), path.runs.end(), [](const auto& run) { return run.steep != Steep::no; });
}

template <class M>
bool is_stiff(const PointPath<M>& path) {
  return std::any_of(path.runs.begin(), path.runs.end(), [](const auto& run) { return run.implicit; });
}

// use(share) for the parts of a step over which the distance to a surface grows, or falls, by `growth` (outcome.hpp), as shares
// of it: over each of them by less than three times, down to a smallest part.
void for_each_part(double growth, auto&& use) {
  constexpr int most_halvings = 12;
  const int halvings = growth == 0.0 ? 0 : std::min(most_halvings, static_cast<int>(std::log2(std::abs(growth))));
  for (int k = 0; k <= halvings; ++k) {
    const int behind = growth < 0.0 ? halvings - k : k;  // how many parts lie nearer to the surface
    use(std::ldexp(1.0, std::max(behind, 1) - 1 - halvings));
  }
}

// As a share of the duration: shorter than what rounding leaves of it.
inline constexpr double least_tail = 1e-18;

// For which memory is taken at once.
inline constexpr std::size_t usual_steps = 64;

// The columns need finer steps than the states; those that are sampled within them are finer already (dense_output.hpp).
inline constexpr double first_refinement = 1.4, refinement_of_sampled = 1.1;

// The same path in about `factor` times as many steps, whose sizes change along it as they did.
template <class M>
PointPath<M> refined(const PointPath<M>& path, double factor) {
  PointPath<M> finer = path.without_steps();
  finer.sizes.reserve(static_cast<std::size_t>(factor * path.size()) + path.runs.size());
  finer.runs.reserve(path.runs.size());
  finer.fineness *= factor;
  std::size_t first = 0;
  for (const auto& run : path.runs) {
    const double coarse = static_cast<double>(run.end - first),
                 parts = run.steep == Steep::no ? std::ceil(coarse * factor) : 1.0;
    std::size_t n = first;
    double rest = 1.0;  // of step n, as a share of it
    for (int part = 0; part < parts; ++part) {
      double share = coarse / parts, size = 0.0;
      for (; share > rest && n + 1 < run.end; rest = 1.0) size += rest * path.sizes[n++], share -= rest;
      const double taken = part + 1 < parts ? std::min(share, rest) : rest;
      finer.sizes.push_back(size + taken * path.sizes[n]);
      rest -= taken;
    }
    finer.runs.push_back({finer.sizes.size(), run.side, run.implicit, run.steep, run.first_reset, run.resets_end});
    first = run.end;
  }
  return finer;
}

// The same path with the steps beside its kinks divided by halves towards them: f_x may rise like a root there.
template <class M>
PointPath<M> graded(const PointPath<M>& path) {
  PointPath<M> finer = path.without_steps();
  std::size_t first = 0;
  for (std::size_t r = 0; r < path.runs.size(); ++r) {
    const auto& run = path.runs[r];
    for (std::size_t n = first; n < run.end; ++n) {
      const bool behind = n == first && r > 0 && run.steep == Steep::no && path.runs[r - 1].steep == Steep::no;
      const bool before = n + 1 == run.end && r + 1 < path.runs.size() && !behind && run.steep == Steep::no &&
                          path.runs[r + 1].steep == Steep::no;
      constexpr std::array<double, 4> shares = {1.0 / 8, 1.0 / 8, 1.0 / 4, 1.0 / 2};
      if (!behind && !before) finer.push_back(path.sizes[n], run.side, run.implicit, run.steep, run.resets_end);
      for (std::size_t part = 0; (behind || before) && part < shares.size(); ++part)
        finer.push_back(path.sizes[n] * shares[behind ? part : shares.size() - 1 - part], run.side, run.implicit, Steep::no,
                        run.resets_end);
    }
    first = run.end;
  }
  return finer;
}

// Of the way to a surface where f_x has no bounds, the largest part that one step takes.
inline constexpr double most_of_distance = 0.35;
// And by how much smaller these parts may become.
inline constexpr double finest = 16.0;

// How the lanes take a step. `beside`: from or to a kink or jump. To a surface where f_x has no bounds, or from one, by such
// parts of the way; `other`: the sides behind it, or before.
template <class M, class P>
struct StepKind {
  mask_of_lanes<P> implicit = lanes_of<P>::none(), beside = lanes_of<P>::none();
  mask_of_lanes<P> towards = lanes_of<P>::none(), away = lanes_of<P>::none();
  typename ArraysOf<M, P>::Sides other;
  P part{most_of_distance};
};

// Whether a run of a path goes to or from surfaces where f_x has no bounds.
template <class P, class M>
void note_steep(const PointPath<M>& path, std::size_t run, int lane, StepKind<M, P>& kind) {
  const auto& here = path.runs[run];
  lanes_of<P>::set(kind.towards, lane, here.steep == Steep::towards);
  lanes_of<P>::set(kind.away, lane, here.steep == Steep::away);
  lanes_of<P>::set(kind.part, lane, most_of_distance / std::min(path.fineness, finest));
  auto other = here.side;
  if (here.steep == Steep::towards) other = path.runs[run + 1].side;
  if (here.steep == Steep::away && run > 0) other = path.runs[run - 1].side;
  if (here.steep == Steep::away && run == 0)
    for (const int m : path.starts_on) other[m] = -here.side[m];
  set_lane(kind.other, lane, other.data());
}
// What is set anew before a step, lane by lane: which states, of one reset after the other, and on which jump.
template <class P>
struct ResetsOfLanes {
  mask_of_lanes<P> lanes = lanes_of<P>::none();
  P surface{-1.0};
  std::vector<P> which;

  void add(int lane, std::span<const ResetAt> of_lane) {
    for (std::size_t n = 0; n < of_lane.size(); ++n) {
      lanes_of<P>::set(lanes, lane, true);
      if (n == 0) lanes_of<P>::set(surface, lane, of_lane[n].surface);
      if (which.size() == n) which.push_back(P(0.0));
      lanes_of<P>::set(which[n], lane, of_lane[n].which);
    }
  }
};

// advance(size, side, kind) for every step of the paths of points[rows[0]], ...; of size 0 in the lanes whose path has ended.
// Before it pass(before, after, resets) where the sides of any lane change, those of jumps among them.
template <class P, class M>
void for_each_step(const Shape<M>& shape, std::span<const std::size_t> rows, const std::vector<PointPath<M>>& paths,
                   auto&& pass, auto&& advance) {
  const int used = static_cast<int>(rows.size());
  std::size_t longest = 0;
  for (const std::size_t k : rows) longest = std::max(longest, paths[k].size());
  typename ArraysOf<M, P>::Sides side, before;
  fit(side, shape.sides);
  side.fill(P(1.0));
  StepKind<M, P> kind;
  fit(kind.other, shape.sides);
  kind.other = side;
  ResetsOfLanes<P> resets;
  const bool steep = std::any_of(rows.begin(), rows.end(), [&](auto k) { return meets_steep(paths[k]); });
  // Of every lane: which run is next, where the current one ends, and the step at which something changes.
  std::array<std::size_t, lanes_of<P>::width> run{}, run_end{}, next{};
  for (std::size_t n = 0; n < longest; ++n) {
    P size(0.0);
    bool turned = false;
    if (!resets.which.empty()) resets = {};
    for (int lane = 0; lane < used; ++lane) {
      const auto& path = paths[rows[lane]];
      if (n >= path.size()) continue;
      lanes_of<P>::set(size, lane, path.sizes[n]);
      if (n < next[lane]) continue;
      const bool first = n == run_end[lane];
      if (first) {
        if (!turned) before = side;
        set_lane(side, lane, path.runs[run[lane]].side.data());
        if (n == 0 && shape.holds_end > 0) set_lane(before, lane, path.start.data());
        const auto& next_run = path.runs[run[lane]];
        if (next_run.resets_end > next_run.first_reset)
          resets.add(lane, std::span(path.resets).subspan(next_run.first_reset, next_run.resets_end - next_run.first_reset));
        lanes_of<P>::set(kind.implicit, lane, path.runs[run[lane]].implicit);
        run_end[lane] = path.runs[run[lane]++].end;
        turned = true;
      }
      const bool another = run[lane] < path.runs.size();  // behind this one
      const bool beside = (first && n > 0) || (another && n + 1 == run_end[lane]);
      lanes_of<P>::set(kind.beside, lane, beside);
      if (steep) note_steep(path, run[lane] - 1, lane, kind);
      next[lane] = beside ? n + 1 : another ? run_end[lane] - 1 : run_end[lane];
    }
    if ((goes_on_from_ends(shape) || shape.holds_end > 0) && turned) pass(before, side, resets);
    advance(size, side, kind);
  }
}

}  // namespace fisherpoint
