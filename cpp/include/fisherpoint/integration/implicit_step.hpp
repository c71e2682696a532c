// One step of Radau IIA (radau.hpp) in every lane that asks for one: the stages by the simplified Newton iteration, each lane
// for as long as it needs, with f_x at the step's start.
//
// The method damps modes that grow where the step is long for them, and so would carry a trajectory along what has lost its
// stability, as where an amount is used up: so f_x at both ends of a step has no eigenvalue past `real` / step. As the step
// goes to zero all pivots of real - step f_x are positive; where signs differ from that, the eigenvalues are counted.
//
// States count in units of their scales here, so that rows of the equations can be compared.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "fisherpoint/integration/radau.hpp"
#include "fisherpoint/integration/step_control.hpp"
#include "fisherpoint/numbers/eigenvalues.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/linear_system.hpp"
#include "fisherpoint/numbers/parts.hpp"
#include "fisherpoint/numbers/shelves.hpp"
#include "fisherpoint/numbers/unroll.hpp"

namespace fisherpoint {

// Next to surfaces where f takes a root of h, the stages are to be known as a share of h, however small that is: how much
// sharper than the tolerance.
template <class Equation, class P>
[[gnu::noinline]] P sharper_beside_roots(const Equation& f, const typename Equation::State& x, double weight) {
  P least(1.0);
  const auto value = f.surface_values(x);
  for_each_index(f.jumps_end, f.holds_end, [&](auto m) {
    typename Equation::State one;
    fit(one, f.states);
    one.fill(P(0.0));
    P size(0.0);
    for_each_index(f.states, [&](auto i) {
      one[i] = P(1.0 / f.inverse_scale(i));
      size += abs(f.surface_rates(x, one)[m]);
      one[i] = P(0.0);
    });
    least = min(least, abs(value[m]) / size);
  });
  return max(P(10.0 / std::sqrt(weight)) / max(least, P(hold_height)), P(1.0));
}

template <class Equation>
class ImplicitStep {
  using P = typename Equation::Number;
  using Lanes = lanes_of<P>;
  using Mask = typename Lanes::mask;
  using State = typename Equation::State;
  using Side = typename Equation::Side;
  using OfPart = PartOf<P>;
  using Increments = std::array<ShelfVector<P>, Radau::stages>;
  static constexpr int most_iterations = 10;
  // What is left of the iteration's error, as a share of the tolerance.
  static constexpr double most_left = 0.01;
  // By how far the step's end may be off, as a squared share of the tolerance.
  static constexpr double most_off = 0.1;
  // The last step's cubic tells little further ahead than this, in units of that step.
  static constexpr double farthest = 4.0;

 public:
  explicit ImplicitStep(const Equation& f)
      : f_(f),
        n_(f.states),
        real_(n_, f.order(), f.parts_in_use()),
        complex_(n_, f.order(), f.parts_in_use()),
        right_(n_),
        right_complex_(n_),
        signs_(2 * n_),
        known_(2 * n_, P(1.0)) {
    for (int i = 0; i < n_; ++i) scales_.push_back(1.0 / f.inverse_scale(i));
    at_place_.resize(real_.places());
    for (int e = 0; e < f.slopes(); ++e) {
      const auto [i, k] = f.slope(e);
      entries_.push_back({i, k, f.inverse_scale(i) * scale(k)});
      at_place_[real_.place(i, k)].entry = e;
    }
    for (int i = 0; i < n_; ++i) at_place_[real_.place(i, i)].diagonal = 1.0;
    for (auto* increments : {&z_, &w_, &f_z_, &cubic_})
      for (auto& values : *increments) values.assign(n_, P(0.0));
    fit(at_, f.states);
    fit(rate_, f.states);
    for (Linearised* place : {&start_, &end_}) {
      fit(place->x, f.states);
      fit(place->side, f.sides);
      place->x.fill(P(std::numeric_limits<double>::quiet_NaN()));
      place->side.fill(P(0.0));
      place->f_x.assign(entries_.size(), P(0.0));
    }
  }

  // Solves for the stages of a step from y, whose rate is `rate`; `weight` is that of squares in step control. Returns the
  // lanes in which that has succeeded. The iteration is to leave this many times less of its error than elsewhere.
  Mask solve(const Mask& lanes, const State& y, const State& rate, const P& step, const Side& side, double weight,
             const P& sharper = P(1.0)) {
    step_ = select(lanes, step, P(0.0));
    linearise_start(lanes, y, side);
    factorise_real(start_);
    complex_.factorise([&](int place) {
      const auto real = entry_of(start_, at_place_[place], Radau::part_re);
      const double imaginary = at_place_[place].diagonal * Radau::part_im;
      return [=](Part part) { return PartOf<Complex<P>>{real(part), OfPart(imaginary)}; };
    });
    begin_iteration();
    iterate(lanes, y, side, weight, sharper * sharper);
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) { part.set(f_y_of(i), part(step_) * f_.inverse_scale(i) * part(rate[i])); });
    return solved_;
  }

  // Where f has no value at a stage that was tried.
  const Mask& unknown() const { return unknown_; }

  // The embedded error, squared and summed over the states; once more behind f at y plus the error, where it is large in
  // these lanes, in which f and y may not fit each other.
  P squared_error(const Mask& afresh, const State& y, const Side& side, double weight) {
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) { part.set(right_[i], part(f_y_of(i)) + weighted(part, Radau::error, z_, i)); });
    real_.solve(right_.data());
    const P sum = squared(right_);
    const Mask again = afresh & (weight * sum > P(1.0));
    if (!any(again)) return sum;
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) { part.set(at_[i], fused(OfPart(scale(i)), part(right_[i]), part(y[i]))); });
    f_.derivative(at_, side, rate_);
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        const OfPart change = part(step_) * f_.inverse_scale(i);
        part.set(right_[i], fused(change, part(rate_[i]), weighted(part, Radau::error, z_, i)));
      });
    real_.solve(right_.data());
    return select(again, squared(right_), sum);
  }

  // Of these lanes those with a mode that grows too fast for the step at its start, from where the rates are `rate`; directly
  // behind `solve`.
  Mask outgrown(const Mask& lanes, const State& rate) {
    return outgrown(lanes, start_, [&](int i) { return rate[i]; });
  }
  // Of these lanes those with such a mode at the step's end, y; and those where y is not what the stages are to be there, which
  // an iteration with f_x from the start does not see of a mode that has become much faster. It drops what solve_real needs.
  Mask lost(const Mask& lanes, const State& y, const Side& side, double weight) {
    end_.x = y;
    end_.side = side;
    f_.jacobian(y, side, end_.f_x.data());
    factorise_real(end_);
    f_.derivative(y, side, rate_);
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        part.set(right_[i], f_.inverse_scale(i) * (part(step_) * (part(rate_[i]) - slope(part, i, 1.0))));
      });
    real_.solve(right_.data());
    return (lanes & !(weight * squared(right_) <= P(most_off))) |
           outgrown(lanes, end_, [&](int i) { return abs(z_[0][i]) + abs(z_[1][i]) + abs(z_[2][i]); });
  }

  // Of the cubic through the stages, in one part: y with what it adds at a share of the step, and its slope there.
  OfPart moved(Part part, const State& y, int i, double share) const {
    std::array<double, 3> weights;
    for (int r = 0; r < Radau::stages; ++r) {
      const auto& q = Radau::cubic[r];
      weights[r] = share * (q[0] + share * (q[1] + share * q[2]));
    }
    return fused(OfPart(scale(i)), weighted(part, weights, z_, i), part(y[i]));
  }
  OfPart slope(Part part, int i, double share) const {
    std::array<double, 3> weights;
    for (int r = 0; r < Radau::stages; ++r) {
      const auto& q = Radau::cubic[r];
      weights[r] = q[0] + share * (2 * q[1] + share * (3 * q[2]));
    }
    return scale(i) * weighted(part, weights, z_, i) / part(step_);
  }
  OfPart at_stage(Part part, const State& y, int stage, int i) const {
    return fused(OfPart(scale(i)), part(z_[stage][i]), part(y[i]));
  }
  P increment(int stage, int i) const { return scale(i) * z_[stage][i]; }
  double scale(int i) const { return scales_[i]; }

  // The step was taken in these lanes: the next one's iteration begins with its cubic.
  void keep(const Mask& taken) {
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        for (int j = 0; j < Radau::stages; ++j) {
          const std::array<double, 3> weights = {Radau::cubic[0][j], Radau::cubic[1][j], Radau::cubic[2][j]};
          part.set(cubic_[j][i], select(part(taken), weighted(part, weights, z_, i), part(cubic_[j][i])));
        }
      });
    last_step_ = select(taken, step_, last_step_);
  }
  // What was kept does not go on.
  void forget(const Mask& lanes) { last_step_ = select(lanes, P(0.0), last_step_); }

  // (real - h f_x) b = the old b, in units of the scales.
  void solve_real(P* b) const { real_.solve(b); }

 private:
  P& f_y_of(int i) { return f_z_[0][i]; }

  void in_parts(auto&& work) const { for_each_part(f_.parts_in_use(), work); }
  static OfPart weighted(Part part, const std::array<double, 3>& weights, const Increments& of, int i) {
    const OfPart first = weights[0] * part(of[0][i]);
    return fused(OfPart(weights[2]), part(of[2][i]), fused(OfPart(weights[1]), part(of[1][i]), first));
  }

  struct AtPlace {
    double diagonal = 0.0;  // of the unit matrix
    int entry = -1;         // of f_x, if there is one
  };
  // f_x somewhere.
  struct Linearised {
    State x;
    Side side;
    ShelfVector<P> f_x;  // entries
  };
  // `from` - h f_x, in units of the scales.
  OfPart coupled(Part part, const OfPart& from, const Linearised& at, std::size_t e) const {
    return fused(-(part(step_) * part(at.f_x[e])), OfPart(entries_[e].scales), from);
  }
  // What is at a place of `real` - h f_x.
  auto entry_of(const Linearised& at, const AtPlace& place, double real) const {
    return [&at, this, e = place.entry, diagonal = place.diagonal * real](Part part) {
      return e < 0 ? OfPart(diagonal) : coupled(part, OfPart(diagonal), at, e);
    };
  }
  void factorise_real(const Linearised& at) {
    real_.factorise([&](int place) { return entry_of(at, at_place_[place], Radau::real); });
  }
  Mask is_at(const Linearised& place, const State& x, const Side& side) const {
    Mask same = !Lanes::none();
    for (int i = 0; i < n_; ++i)
      in_parts([&](Part part) {
        const auto now = part(x[i]), then = part(place.x[i]);
        part.set(same, part(same) & (now <= then) & (now >= then));
      });
    for (int m = 0; m < f_.sides; ++m) same = same & !(abs(side[m] - place.side[m]) > P(0.0));
    return same;
  }
  // A step that is tried again begins where it did, and another where the last one has ended.
  void linearise_start(const Mask& lanes, const State& y, const Side& side) {
    const Mask again = is_at(start_, y, side), goes_on = is_at(end_, y, side);
    if (any(lanes & !again & !goes_on)) {
      f_.jacobian(y, side, start_.f_x.data());
    } else if (any(lanes & !again)) {
      for (std::size_t e = 0; e < entries_.size(); ++e)
        in_parts([&](Part part) { part.set(start_.f_x[e], select(part(again), part(start_.f_x[e]), part(end_.f_x[e]))); });
    }
    start_.x = y;
    start_.side = side;
  }

  // Where signs are not those of steps without such modes. A state that does not move, and has a rate by itself alone, rests
  // where it is, whatever becomes of others beside it.
  Mask outgrown(const Mask& lanes, const Linearised& at, auto&& moved) {
    real_.signs(signs_.data());
    std::fill_n(&signs_[n_], n_, P(1.0));
    for (std::size_t e = 0; e < entries_.size(); ++e)
      if (const int i = entries_[e].row; i == entries_[e].column)
        in_parts([&](Part part) {
          const auto negative = coupled(part, OfPart(Radau::real), at, e) < OfPart(0.0);
          part.set(signs_[n_ + i], select(negative, OfPart(-1.0), OfPart(1.0)));
        });
    Mask unlike = real_.weak();
    for (int i = 0; i < 2 * n_; ++i)
      in_parts([&](Part part) { part.set(unlike, part(unlike) | (part(signs_[i]) * part(known_[i]) < OfPart(0.0))); });
    unlike = unlike & lanes;
    return any(unlike) ? counted(unlike, at, moved) : unlike;
  }
  [[gnu::noinline]] Mask counted(const Mask& lanes, const Linearised& at, auto&& moved) {
    ShelfVector<P> matrix(n_ * n_, P(0.0));
    ShelfVector<Mask> rests(n_);
    Mask any_rests = Lanes::none();
    for (int i = 0; i < n_; ++i) {
      rests[i] = !(abs(moved(i)) > P(0.0));
      matrix[i * n_ + i] = P(Radau::real);
    }
    for (std::size_t e = 0; e < entries_.size(); ++e)
      if (const int i = entries_[e].row; i != entries_[e].column) rests[i] = rests[i] & !(abs(at.f_x[e]) > P(0.0));
    for (const Mask& one : rests) any_rests = any_rests | one;
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      P& entry = matrix[entries_[e].row * n_ + entries_[e].column];
      in_parts([&](Part part) {
        part.set(entry, select(part(rests[entries_[e].row]), part(entry), coupled(part, part(entry), at, e)));
      });
    }
    const Mask outgrown = lanes & (eigenvalues_on_left(matrix, n_) > P(0.5));
    const Mask harmless = lanes & !outgrown & !any_rests;
    for (int j = 0; j < 2 * n_; ++j) known_[j] = select(harmless, signs_[j], known_[j]);
    return outgrown;
  }

  P squared(const ShelfVector<P>& values) const {
    P sum(0.0);
    for (const P& value : values) in_parts([&](Part part) { part.set(sum, fused(part(value), part(value), part(sum))); });
    return sum;
  }

  // Where there is a last step near enough its cubic goes on; elsewhere the state rests.
  void begin_iteration() {
    const P ratio = step_ / last_step_;
    const Mask known = (last_step_ > P(0.0)) & (ratio <= P(farthest));
    for (int r = 0; r < Radau::stages; ++r) {
      const P s = 1.0 + Radau::c[r] * ratio, s2 = s * s, s3 = in_register(s2 * s);
      const P of_first = s - 1.0, of_second = s2 - 1.0, of_third = s3 - 1.0;
      for (int i = 0; i < n_; ++i)
        in_parts([&](Part part) {
          const OfPart first = part(of_first) * part(cubic_[0][i]);
          const OfPart two = fused(part(of_second), part(cubic_[1][i]), first);
          part.set(z_[r][i], select(part(known), fused(part(of_third), part(cubic_[2][i]), two), OfPart(0.0)));
        });
    }
    for (int i = 0; i < n_; ++i) in_parts([&](Part part) { transform(part, w_, Radau::to_w, z_, i); });
  }

  static void transform(Part part, Increments& out, const std::array<std::array<double, 3>, 3>& matrix, const Increments& in,
                        int i) {
    for (int r = 0; r < Radau::stages; ++r) part.set(out[r][i], weighted(part, matrix[r], in, i));
  }

  [[gnu::noinline]] void iterate(const Mask& lanes, const State& y, const Side& side, double weight, const P& sharper) {
    const P floor = (1e-30 * weight) * (f_.squared_size(y) + P(1.0)) * sharper;  // of rounding
    Mask iterates = lanes;
    solved_ = unknown_ = Lanes::none();
    P last(0.0);
    for (int k = 0; k < most_iterations && any(iterates); ++k) {
      for (int r = 0; r < Radau::stages; ++r) {
        for (int i = 0; i < n_; ++i)
          in_parts([&](Part part) { part.set(at_[i], fused(OfPart(scale(i)), part(z_[r][i]), part(y[i]))); });
        f_.derivative(at_, side, rate_);
        for (int i = 0; i < n_; ++i)
          in_parts([&](Part part) { part.set(f_z_[r][i], part(step_) * f_.inverse_scale(i) * part(rate_[i])); });
      }
      for (int i = 0; i < n_; ++i) in_parts([&](Part part) { set_right(part, i); });
      real_.solve(right_.data());
      complex_.solve(right_complex_.data());
      P size(0.0);
      for (int i = 0; i < n_; ++i)
        in_parts([&](Part part) {
          const OfPart a = part(right_[i]), re = part(right_complex_[i].re), im = part(right_complex_[i].im);
          part.set(size, part(size) + fused(im, im, fused(re, re, a * a)));
          const auto add = [&](P& w, const OfPart& more) { part.set(w, select(part(iterates), part(w) + more, part(w))); };
          add(w_[0][i], a);
          add(w_[1][i], re);
          add(w_[2][i], im);
          transform(part, z_, Radau::to_z, w_, i);
        });
      size *= weight * sharper;
      unknown_ = unknown_ | (iterates & !(size < P(1e300)));
      // The iteration shrinks what is left by about the same factor every time.
      const P factor = sqrt(size / last);
      const Mask small = k > 0 ? (factor < P(1.0)) & (factor * sqrt(size) <= most_left * (1.0 - factor)) : Lanes::none();
      const Mask done = iterates & ((size <= floor) | small);
      solved_ = solved_ | done;
      iterates = iterates & !done & !unknown_ & (k > 0 ? factor < P(1.0) : !Lanes::none());
      last = size;
    }
  }

  // The residual of the stage equations, transformed as W is: the right-hand side of a Newton step.
  void set_right(Part part, int i) {
    const auto of_rates = [&](int r) { return weighted(part, Radau::to_w[r], f_z_, i); };
    const OfPart real(Radau::real), re(Radau::part_re), im(Radau::part_im);
    const OfPart w = part(w_[0][i]), u = part(w_[1][i]), v = part(w_[2][i]);
    part.set(right_[i], fused(-real, w, of_rates(0)));
    part.set(right_complex_[i], {of_rates(1) - fused(-im, v, re * u), of_rates(2) - fused(im, u, re * v)});
  }

  const Equation& f_;
  int n_;
  P step_{0.0}, last_step_{0.0};
  Mask solved_ = Lanes::none(), unknown_ = Lanes::none();
  LinearSystem<P> real_;
  LinearSystem<Complex<P>> complex_;
  struct EntryOfSlopes {
    int row, column;
    double scales;  // the rate's over the state's
  };
  std::vector<double> scales_;  // of the states
  std::vector<EntryOfSlopes> entries_;
  std::vector<AtPlace> at_place_;  // of both systems
  Linearised start_, end_;         // of the step
  ShelfVector<P> right_;
  ShelfVector<Complex<P>> right_complex_;
  // Of real - h f_x, the signs of its pivots and of its diagonal: here, and where eigenvalues are known to be harmless.
  ShelfVector<P> signs_, known_;
  Increments z_, w_, f_z_, cubic_;  // stages, their transforms, h f at the stages, and the last step's cubic
  State at_, rate_;
};

}  // namespace fisherpoint
