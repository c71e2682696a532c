// On which sides of several jumps a trajectory goes on that is on all of them: with r = r0 + R s the rates of their h, each s_i
// is 1 where r_i leads up, -1 where it leads down, and between where r_i is zero, on a slide. A linear complementarity problem
// with bounds. Where the friction of joints and legs is the matrix, it has one solution.
#pragma once

#include <cmath>
#include <vector>

namespace fisherpoint {

// Of one trajectory: n jumps, the rates r0 at s = 0, and R row by row. True where s was found, with 0 for a slide.
class BoxSides {
 public:
  BoxSides(int n, std::vector<double> r0, std::vector<double> r)
      : n_(n), r0_(std::move(r0)), r_(std::move(r)), s_(n), free_(n, true), even_(n, false) {
    for (int i = 0; i < n; ++i) {
      double size = std::abs(r0_[i]);
      for (int j = 0; j < n; ++j) size += std::abs(at(i, j));
      size_.push_back(size);
    }
  }

  double operator[](int i) const { return s_[i]; }

  // Whether h of jump i does not move on its side, to rounding: as much holds it as moves it away.
  bool even(int i) const { return even_[i]; }

  // Jump i is on this side whatever the rates are.
  void set(int i, double side) {
    s_[i] = side;
    free_[i] = false;
  }

  // Whether h of jump i does not move to the other side than it is on, to a part of the sizes.
  bool stays(int i, double part) const { return s_[i] * rate(i) >= -part * size_[i]; }

  bool solve() {
    fix_what_is_sure();
    int left = 0;
    bool opposes = true;
    for (int i = 0; i < n_; ++i) {
      left += free_[i];
      opposes = opposes && (!free_[i] || at(i, i) < -rounding * size_[i]);
    }
    if (left == 0) return true;
    return opposes ? exchange() : left <= most_tried && try_all();
  }

 private:
  static constexpr double rounding = 1e-10;  // of rates, in units of the sizes of their parts
  static constexpr double at_bound = 1e-11;  // s so near to its bounds is no slide
  static constexpr int most_exchanges = 2000, most_tried = 6;

  double at(int i, int j) const { return r_[i * n_ + j]; }

  // Of all others that are on sides, and of what is between.
  double rate(int i) const {
    double sum = r0_[i];
    for (int j = 0; j < n_; ++j) sum += at(i, j) * s_[j];
    return sum;
  }

  // Whatever the others do.
  void fix_what_is_sure() {
    for (bool found = true; found;) {
      found = false;
      for (int i = 0; i < n_; ++i) {
        if (!free_[i]) continue;
        double middle = r0_[i], reach = 0.0;
        for (int j = 0; j < n_; ++j) free_[j] ? reach += std::abs(at(i, j)) : middle += at(i, j) * s_[j];
        if (std::abs(middle) <= reach + rounding * size_[i]) continue;
        s_[i] = middle > 0.0 ? 1.0 : -1.0;
        free_[i] = false;
        found = true;
      }
    }
  }

  // K. G. Murty's rule of the least index: of the first that is wrong, the side is changed. It ends for P-matrices.
  bool exchange() {
    std::vector<int> side(n_, 0);
    for (int count = 0; count < most_exchanges; ++count) {
      if (!slide(side)) return false;
      int wrong = -1, instead = 0;
      for (int i = 0; i < n_ && wrong < 0; ++i) {
        if (!free_[i]) continue;
        if (side[i] == 0 && std::abs(s_[i]) > 1.0 - at_bound)
          wrong = i, instead = s_[i] > 0.0 ? 1 : -1;
        else if (side[i] != 0 && side[i] * rate(i) < -rounding * size_[i])
          wrong = i, instead = 0;
      }
      if (wrong < 0) return take(side);
      side[wrong] = instead;
    }
    return false;
  }

  // Where jumps lead away on both sides: the only one of all that is consistent.
  bool try_all() {
    std::vector<int> side(n_, 0), found;
    for (int i = 0; i < n_; ++i) side[i] = free_[i] ? -1 : 0;
    int solutions = 0;
    while (true) {
      if (slide(side) && consistent(side) && ++solutions == 1) found = side;
      int i = 0;
      while (i < n_ && (!free_[i] || side[i] == 1)) {
        if (free_[i]) side[i] = -1;
        ++i;
      }
      if (i == n_) break;
      ++side[i];
    }
    return solutions == 1 && slide(found) && take(found);
  }

  bool consistent(const std::vector<int>& side) const {
    for (int i = 0; i < n_; ++i) {
      if (!free_[i]) continue;
      if (side[i] == 0 && !(std::abs(s_[i]) < 1.0 - at_bound)) return false;
      if (side[i] != 0 && side[i] * rate(i) < -rounding * size_[i]) return false;
    }
    return true;
  }

  // s still is what slide() found on these sides.
  bool take(const std::vector<int>& side) {
    for (int i = 0; i < n_; ++i) even_[i] = free_[i] && side[i] != 0 && std::abs(rate(i)) <= 2.0 * at_bound * size_[i];
    for (int i = 0; i < n_; ++i)
      if (free_[i]) s_[i] = side[i];
    return true;
  }

  // s where the sides are 0, from r_i = 0; false where the slide would not hold. Elimination without exchanges: of a P-matrix
  // all pivots have one sign.
  bool slide(const std::vector<int>& side) {
    std::vector<int> on;
    for (int i = 0; i < n_; ++i) {
      if (!free_[i]) continue;
      s_[i] = side[i];
      if (side[i] == 0) on.push_back(i);
    }
    const int k = static_cast<int>(on.size());
    std::vector<double> a(k * (k + 1));
    const auto entry = [&](int i, int j) -> double& { return a[i * (k + 1) + j]; };
    for (int i = 0; i < k; ++i) {
      for (int j = 0; j < k; ++j) entry(i, j) = at(on[i], on[j]);
      entry(i, k) = -rate(on[i]);
    }
    for (int p = 0; p < k; ++p) {
      if (!(entry(p, p) < -rounding * size_[on[p]])) return false;
      for (int i = p + 1; i < k; ++i) {
        const double factor = entry(i, p) / entry(p, p);
        for (int j = p; j <= k; ++j) entry(i, j) -= factor * entry(p, j);
      }
    }
    for (int p = k; p-- > 0;) {
      for (int j = p + 1; j < k; ++j) entry(p, k) -= entry(p, j) * s_[on[j]];
      s_[on[p]] = entry(p, k) / entry(p, p);
    }
    return true;
  }

  int n_;
  std::vector<double> r0_, r_, s_, size_;
  std::vector<bool> free_, even_;
};

}  // namespace fisherpoint
