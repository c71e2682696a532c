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
#include "fisherpoint/numbers/first_part.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/linear_system.hpp"
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
        real_(n_, f.order(), f.first_part_alone()),
        complex_(n_, f.order(), f.first_part_alone()),
        right_(n_),
        right_complex_(n_),
        signs_(2 * n_),
        known_(2 * n_, P(1.0)) {
    for (int e = 0; e < f.slopes(); ++e) {
      const auto [i, k] = f.slope(e);
      entries_.push_back({i, k, real_.place(i, k)});
    }
    for (int i = 0; i < n_; ++i) diagonal_.push_back(real_.place(i, i));
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
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) {
      set_up_real<Q>(start_);
      set_up_complex<Q>(start_);
    });
    real_.factorise();
    complex_.factorise();
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) {
      begin_iteration<Q>();
      iterate<Q>(lanes, y, side, weight, sharper * sharper);
      for (int i = 0; i < n_; ++i) write_as(f_y_of(i), read_as<Q>(step_) * f_.inverse_scale(i) * read_as<Q>(rate[i]));
    });
    return solved_;
  }

  // Where f has no value at a stage that was tried.
  const Mask& unknown() const { return unknown_; }

  // The embedded error, squared and summed over the states; once more behind f at y plus the error, where it is large in
  // these lanes, in which f and y may not fit each other.
  P squared_error(const Mask& afresh, const State& y, const Side& side, double weight) {
    P sum(0.0);
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) {
      for (int i = 0; i < n_; ++i) write_as(right_[i], read_as<Q>(f_y_of(i)) + of_stages<Q>(Radau::error, i));
      real_.solve(right_.data());
      write_as(sum, squared<Q>(right_));
    });
    const Mask again = afresh & (weight * sum > P(1.0));
    if (!any(again)) return sum;
    for (int i = 0; i < n_; ++i) at_[i] = y[i] + scale(i) * right_[i];
    f_.derivative(at_, side, rate_);
    for (int i = 0; i < n_; ++i) right_[i] = step_ * f_.inverse_scale(i) * rate_[i] + of_stages<P>(Radau::error, i);
    real_.solve(right_.data());
    return select(again, squared<P>(right_), sum);
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
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) { set_up_real<Q>(end_); });
    real_.factorise();
    f_.derivative(y, side, rate_);
    P off(0.0);
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) {
      for (int i = 0; i < n_; ++i) {
        const Q apart = read_as<Q>(step_) * (read_as<Q>(rate_[i]) - slope<Q>(i, 1.0));
        write_as(right_[i], f_.inverse_scale(i) * apart);
      }
      real_.solve(right_.data());
      write_as(off, squared<Q>(right_));
    });
    return (lanes & !(weight * off <= P(most_off))) |
           outgrown(lanes, end_, [&](int i) { return abs(z_[0][i]) + abs(z_[1][i]) + abs(z_[2][i]); });
  }

  // Of the cubic through the stages: what it adds to y at a share of the step, and its slope there.
  template <class Q = P>
  Q change(int i, double share) const {
    Q sum(0.0);
    for (int r = 0; r < Radau::stages; ++r) {
      const auto& q = Radau::cubic[r];
      sum += (share * (q[0] + share * (q[1] + share * q[2]))) * read_as<Q>(z_[r][i]);
    }
    return scale(i) * sum;
  }
  template <class Q = P>
  Q slope(int i, double share) const {
    Q sum(0.0);
    for (int r = 0; r < Radau::stages; ++r) {
      const auto& q = Radau::cubic[r];
      sum += (q[0] + share * (2 * q[1] + share * (3 * q[2]))) * read_as<Q>(z_[r][i]);
    }
    return scale(i) * sum / read_as<Q>(step_);
  }
  P increment(int stage, int i) const { return scale(i) * z_[stage][i]; }

  // The step was taken in these lanes: the next one's iteration begins with its cubic.
  void keep(const Mask& taken) {
    on_lanes_in_use(f_, [&]<class Q>(As<Q>) {
      const auto by_lane = read_as<Q>(taken);
      for (int i = 0; i < n_; ++i)
        for (int j = 0; j < Radau::stages; ++j) {
          Q q(0.0);
          for (int r = 0; r < Radau::stages; ++r) q += Radau::cubic[r][j] * read_as<Q>(z_[r][i]);
          write_as(cubic_[j][i], select(by_lane, q, read_as<Q>(cubic_[j][i])));
        }
    });
    last_step_ = select(taken, step_, last_step_);
  }
  // What was kept does not go on.
  void forget(const Mask& lanes) { last_step_ = select(lanes, P(0.0), last_step_); }

  // (real - h f_x) b = the old b, in units of the scales.
  void solve_real(P* b) const { real_.solve(b); }

 private:
  double scale(int i) const { return 1.0 / f_.inverse_scale(i); }
  P& f_y_of(int i) { return f_z_[0][i]; }

  template <class Q>
  Q of_stages(const std::array<double, 3>& weights, int i) const {
    return sum<Q>(weights, z_, i);
  }
  // Each product but one is rounded with the sum, in whatever the call stands: a lane has the same bits in any part of a pack.
  template <class Q>
  static Q sum(const std::array<double, 3>& weights, const Increments& of, int i) {
    const Q first = weights[0] * read_as<Q>(of[0][i]);
    return fused(Q(weights[2]), read_as<Q>(of[2][i]), fused(Q(weights[1]), read_as<Q>(of[1][i]), first));
  }

  // f_x somewhere.
  struct Linearised {
    State x;
    Side side;
    ShelfVector<P> f_x;  // entries
  };
  // -h f_x, in units of the scales.
  template <class Q = P>
  Q coupling(const Linearised& at, std::size_t e) const {
    const double scales = f_.inverse_scale(entries_[e].row) * scale(entries_[e].column);
    return -(read_as<Q>(step_) * read_as<Q>(at.f_x[e]) * scales);
  }
  template <class Q>
  void set_up_real(const Linearised& at) {
    real_.clear();
    for (const int place : diagonal_) real_.at(place) = P(Radau::real);
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      P& entry = real_.at(entries_[e].place);
      write_as(entry, read_as<Q>(entry) + coupling<Q>(at, e));
    }
  }
  template <class Q>
  void set_up_complex(const Linearised& at) {
    complex_.clear();
    for (const int place : diagonal_) complex_.at(place) = {P(Radau::part_re), P(Radau::part_im)};
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      P& entry = complex_.at(entries_[e].place).re;
      write_as(entry, read_as<Q>(entry) + coupling<Q>(at, e));
    }
  }
  Mask is_at(const Linearised& place, const State& x, const Side& side) const {
    Mask same = !Lanes::none();
    for (int i = 0; i < n_; ++i) same = same & (x[i] <= place.x[i]) & (x[i] >= place.x[i]);
    for (int m = 0; m < f_.sides; ++m) same = same & !(abs(side[m] - place.side[m]) > P(0.0));
    return same;
  }
  // A step that is tried again begins where it did, and another where the last one has ended.
  void linearise_start(const Mask& lanes, const State& y, const Side& side) {
    const Mask again = is_at(start_, y, side), goes_on = is_at(end_, y, side);
    if (any(lanes & !again & !goes_on)) {
      f_.jacobian(y, side, start_.f_x.data());
    } else if (any(lanes & !again)) {
      for (std::size_t e = 0; e < entries_.size(); ++e) start_.f_x[e] = select(again, start_.f_x[e], end_.f_x[e]);
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
      if (const auto [i, k, place] = entries_[e]; i == k)
        signs_[n_ + i] = select(Radau::real + coupling(at, e) < P(0.0), P(-1.0), P(1.0));
    Mask unlike = real_.weak();
    for (int i = 0; i < n_; ++i) {
      unlike = unlike | (signs_[i] * known_[i] < P(0.0)) | (signs_[n_ + i] * known_[n_ + i] < P(0.0));
    }
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
      if (const auto [i, k, place] = entries_[e]; i != k) rests[i] = rests[i] & !(abs(at.f_x[e]) > P(0.0));
    for (const Mask& one : rests) any_rests = any_rests | one;
    for (std::size_t e = 0; e < entries_.size(); ++e) {
      P& entry = matrix[entries_[e].row * n_ + entries_[e].column];
      entry = select(rests[entries_[e].row], entry, entry + coupling(at, e));
    }
    const Mask outgrown = lanes & (eigenvalues_on_left(matrix, n_) > P(0.5));
    const Mask harmless = lanes & !outgrown & !any_rests;
    for (int j = 0; j < 2 * n_; ++j) known_[j] = select(harmless, signs_[j], known_[j]);
    return outgrown;
  }

  template <class Q>
  static Q squared(const ShelfVector<P>& values) {
    Q sum(0.0);
    for (const P& value : values) sum += read_as<Q>(value) * read_as<Q>(value);
    return sum;
  }

  // Where there is a last step near enough its cubic goes on; elsewhere the state rests.
  template <class Q>
  void begin_iteration() {
    const P all = step_ / last_step_;
    const auto known = read_as<Q>((last_step_ > P(0.0)) & (all <= P(farthest)));
    const Q ratio = read_as<Q>(all);
    for (int r = 0; r < Radau::stages; ++r) {
      const Q s = 1.0 + Radau::c[r] * ratio, s2 = s * s, s3 = s2 * s;
      for (int i = 0; i < n_; ++i) {
        const Q first = (s - 1.0) * read_as<Q>(cubic_[0][i]);
        const Q ahead = fused(s3 - 1.0, read_as<Q>(cubic_[2][i]), fused(s2 - 1.0, read_as<Q>(cubic_[1][i]), first));
        write_as(z_[r][i], select(known, ahead, Q(0.0)));
      }
    }
    for (int i = 0; i < n_; ++i) to<Q>(w_, Radau::to_w, z_, i);
  }

  template <class Q>
  static void to(Increments& out, const std::array<std::array<double, 3>, 3>& matrix, const Increments& in, int i) {
    for (int r = 0; r < Radau::stages; ++r) write_as(out[r][i], sum<Q>(matrix[r], in, i));
  }

  template <class Q>
  [[gnu::noinline]] void iterate(const Mask& lanes, const State& y, const Side& side, double weight, const P& sharper) {
    using SomeLanes = lanes_of<Q>;
    const Q floor = read_as<Q>((1e-30 * weight) * (f_.squared_size(y) + P(1.0)) * sharper);  // of rounding
    const Q step = read_as<Q>(step_), sharp = read_as<Q>(sharper);
    auto iterates = read_as<Q>(lanes), solved = SomeLanes::none(), unknown = SomeLanes::none();
    Q last(0.0);
    for (int k = 0; k < most_iterations && any(iterates); ++k) {
      for (int r = 0; r < Radau::stages; ++r) {
        for (int i = 0; i < n_; ++i) write_as(at_[i], read_as<Q>(y[i]) + scale(i) * read_as<Q>(z_[r][i]));
        f_.derivative(at_, side, rate_);
        for (int i = 0; i < n_; ++i) write_as(f_z_[r][i], step * f_.inverse_scale(i) * read_as<Q>(rate_[i]));
      }
      for (int i = 0; i < n_; ++i) {
        const auto of_rates = [&](int r) { return sum<Q>(Radau::to_w[r], f_z_, i); };
        const Q &w0 = read_as<Q>(w_[0][i]), &w1 = read_as<Q>(w_[1][i]), &w2 = read_as<Q>(w_[2][i]);
        write_as(right_[i], of_rates(0) - Radau::real * w0);
        const Q re(Radau::part_re), im(Radau::part_im);
        write_as(right_complex_[i].re, of_rates(1) - fused(-im, w2, re * w1));
        write_as(right_complex_[i].im, of_rates(2) - fused(im, w1, re * w2));
      }
      real_.solve(right_.data());
      complex_.solve(right_complex_.data());
      Q size(0.0);
      for (int i = 0; i < n_; ++i) {
        const Q &a = read_as<Q>(right_[i]), &re = read_as<Q>(right_complex_[i].re), &im = read_as<Q>(right_complex_[i].im);
        size += fused(im, im, fused(re, re, a * a));
        const auto add = [&](P& w, const Q& more) { write_as(w, select(iterates, read_as<Q>(w) + more, read_as<Q>(w))); };
        add(w_[0][i], a);
        add(w_[1][i], re);
        add(w_[2][i], im);
        to<Q>(z_, Radau::to_z, w_, i);
      }
      size *= weight * sharp;
      unknown = unknown | (iterates & !(size < Q(1e300)));
      // The iteration shrinks what is left by about the same factor every time.
      const Q factor = sqrt(size / last);
      const auto small = k > 0 ? (factor < Q(1.0)) & (factor * sqrt(size) <= most_left * (1.0 - factor)) : SomeLanes::none();
      const auto done = iterates & ((size <= floor) | small);
      solved = solved | done;
      iterates = iterates & !done & !unknown & (k > 0 ? factor < Q(1.0) : !SomeLanes::none());
      last = size;
    }
    solved_ = unknown_ = Lanes::none();
    write_as(solved_, solved);
    write_as(unknown_, unknown);
  }

  const Equation& f_;
  int n_;
  P step_{0.0}, last_step_{0.0};
  Mask solved_ = Lanes::none(), unknown_ = Lanes::none();
  LinearSystem<P> real_;
  LinearSystem<Complex<P>> complex_;
  struct EntryOfSlopes {
    int row, column, place;  // in both systems
  };
  std::vector<EntryOfSlopes> entries_;
  std::vector<int> diagonal_;
  Linearised start_, end_;  // of the step
  ShelfVector<P> right_;
  ShelfVector<Complex<P>> right_complex_;
  // Of real - h f_x, the signs of its pivots and of its diagonal: here, and where eigenvalues are known to be harmless.
  ShelfVector<P> signs_, known_;
  Increments z_, w_, f_z_, cubic_;  // stages, their transforms, h f at the stages, and the last step's cubic
  State at_, rate_;
};

}  // namespace fisherpoint
