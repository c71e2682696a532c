// A function along a step as the quartic through both ends, both slopes and the middle, in Bernstein form: the curve lies in
// the hull of the coefficients, so coefficients of one sign prove that there is no zero.
#pragma once

#include "fisherpoint/numbers/pack.hpp"

namespace fisherpoint {

template <class P>
struct Quartic {
  P b0, b1, b2, b3, b4;

  // Slopes are per whole step.
  static Quartic through(const P& start, const P& start_slope, const P& middle, const P& end, const P& end_slope) {
    const P b1 = start + 0.25 * start_slope, b3 = end - 0.25 * end_slope;
    return {start, b1, (1.0 / 6.0) * (16.0 * middle - start - 4.0 * (b1 + b3) - end), b3, end};
  }

  P least_inside() const { return min(min(b1, b2), b3); }

  // What may lie beside a quartic: a quarter of what it adds to the cubic through both ends.
  P margin() const { return 0.25 * abs(b2 - (1.0 / 6.0) * (4.0 * (b1 + b3) - b0 - b4)); }

  // Whether the curve stays positive between its ends, with its margin and by how much the function was seen to be beside it.
  auto clear(const P& beside = P(0.0)) const { return least_inside() > margin() + beside; }

  // NaN where any number of it is: all are in b2, and min takes its second.
  P least() const { return min(min(min(b0, b4), min(b1, b3)), b2); }
  P change() const { return max(max(b0, b4), max(max(b1, b2), b3)) - least(); }

  // Whether it stays so far from zero, for how it changes, that it is positive at its ends and clear between them, and that a
  // tangent at either end is zero no nearer than half a step beyond it. Not where it is NaN.
  auto keeps_off() const { return least() > 0.4 * change(); }

  // Whether it changes by a good part of what it is, and bends like something that goes up and down: what lies beside it
  // matters.
  auto wavers() const {
    const P third = abs(b3 - b0 + 3.0 * (b1 - b2)) + abs(b4 - b1 + 3.0 * (b2 - b3));
    return (least() < 2.0 * change()) & (third > 0.1 * change());
  }

  // Its value at a share t of the step.
  P at(double t) const {
    const double r = 1.0 - t;
    return r * r * (r * r * b0 + 4.0 * r * t * b1 + 6.0 * t * t * b2) + t * t * t * (4.0 * r * b3 + t * b4);
  }

  // Where it falls through zero, as a share of the step, for a quartic that starts positive, or at zero and rising, and ends
  // negative: Newton's method, kept within the bracket by bisection.
  P zero() const {
    const Quartic h = without_start();
    P low(0.0), high(1.0);
    P s = max(P(0.0), h.b0) / (max(P(0.0), h.b0) - min(h.b4, P(-1e-300)));
    // From next to zero it may fall far below its end, and bisection does not get near the start.
    s = select((h.b0 > P(0.0)) & (h.b0 < -1e-3 * h.b1), h.b0 / (4.0 * (h.b0 - h.b1)), s);
    for (int i = 0; i < 8; ++i) {
      const P r = 1.0 - s;
      const P c0 = r * h.b0 + s * h.b1, c1 = r * h.b1 + s * h.b2, c2 = r * h.b2 + s * h.b3, c3 = r * h.b3 + s * h.b4;
      const P d0 = r * c0 + s * c1, d1 = r * c1 + s * c2, d2 = r * c2 + s * c3;
      const P e0 = r * d0 + s * d1, e1 = r * d1 + s * d2;
      const P value = r * e0 + s * e1, slope = 4.0 * (e1 - e0);
      const auto above = value > P(0.0);
      low = select(above, s, low);
      high = select(above, high, s);
      const P newton = s - value / slope;
      s = select((newton >= low) & (newton <= high), newton, 0.5 * (low + high));
    }
    return s;
  }

 private:
  // Where the start is not positive, but zero or what rounding has left below it: h(s) / s as if it were zero, which has the
  // other zeros alone.
  Quartic without_start() const {
    const auto at_zero = !(b0 > P(0.0));
    return {select(at_zero, 4.0 * b1, b0), select(at_zero, b1 + 1.5 * b2, b1), select(at_zero, b2 + (2.0 / 3.0) * b3, b2),
            select(at_zero, b3 + 0.25 * b4, b3), b4};
  }
};

}  // namespace fisherpoint
