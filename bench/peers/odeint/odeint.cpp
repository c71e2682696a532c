// The cylinder by Boost.odeint: Cash-Karp 5(4) with controlled steps, one trajectory at a time or on packs of
// <experimental/simd>.
//
// A pack shares its steps, and the worst lane decides on them. Trajectories end a step on x_v = 0, whose time is known, and
// start with the first step that the trajectory before got accepted: for states the lanes of a pack are parameter sets of one
// experiment point, for sensitivities they are experiment points, each on its own scale of time.
#include <algorithm>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/algebra/default_operations.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54.hpp>
#include <boost/numeric/odeint/util/resizer.hpp>
#include <cmath>
#include <cstring>
#include <experimental/simd>
#include <vector>

#include "cylinder.hpp"

namespace odeint = boost::numeric::odeint;
namespace simd = std::experimental;
using Pack = simd::native_simd<double>;

template <class T>
constexpr std::size_t lanes = 1;
template <>
constexpr std::size_t lanes<Pack> = Pack::size();

double& lane(double& value, std::size_t) { return value; }
auto lane(Pack& value, std::size_t i) { return value[i]; }
double worst(double value) { return value; }
double worst(const Pack& value) { return simd::hmax(value); }
bool all_finite(double value) { return std::isfinite(value); }
bool all_finite(const Pack& value) { return simd::all_of(simd::abs(value) < 1e300); }
double larger(double a, double b) { return a > b ? a : b; }
Pack larger(const Pack& a, const Pack& b) { return simd::max(a, b); }

// Largest error of a component in units of rtol max(|x|, scale); failed lanes are found by a sum, because a maximum drops NaN.
template <class T, std::size_t size>
struct ErrorChecker {
  using value_type = double;
  using State = std::array<T, size>;
  double rtol;
  const double* scales;

  double error(odeint::array_algebra&, const State& x, const State&, const State& errors, double) const {
    using std::abs;
    T largest = 0.0, sum = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      const T share = abs(errors[i]) / larger(abs(x[i]), T(scales[i]));
      largest = larger(largest, share);
      sum += share;
    }
    return all_finite(sum) ? worst(largest) / rtol : 1e9;
  }
};

struct Experiment {
  const double* x0;
  double u, dt;
};

// On which side the spool starts, and whether and after which time it crosses its centre.
struct Spool {
  bool opens_a, crosses;
  double first;  // the duration of the first piece

  Spool(const Constants& c, const Experiment& e) {
    const double target = c.k_u * e.u, start = e.x0[4], end = target + (start - target) * std::exp(-e.dt / c.T_1);
    opens_a = start > 0;
    crosses = start * end < 0;
    first = crosses ? c.T_1 * std::log((start - target) / -target) : e.dt;
  }
};

// An equation over time in units of `span`.
template <class T, class Equation>
struct Scaled {
  Equation equation;
  T span;

  void operator()(const auto& x, auto& rate, double t) const {
    equation(x, rate, t);
    for (T& r : rate) r *= span;
  }
};

template <class T, template <class, bool> class Equation>
class Solver {
 public:
  static constexpr std::size_t size = Equation<T, true>::size;
  using State = std::array<T, size>;

  Solver(const Constants& c, double rtol, const double* scales)
      : constants(c), stepper(Checker{rtol, scales}, Adjuster(), Stepper()) {}

  // Solve `count` parameter sets, at most one per lane, of one experiment; `first_of_its_kind` forgets the starting steps.
  void solve(const Experiment& e, const double* theta, std::size_t count, bool first_of_its_kind, double* y) {
    T parameters_of[parameters];
    for (std::size_t j = 0; j < parameters; ++j)
      for (std::size_t i = 0; i < lanes<T>; ++i) lane(parameters_of[j], i) = theta[std::min(i, count - 1) * parameters + j];
    const Cylinder<T> cylinder(constants, parameters_of, T(e.u), T(e.x0[1] > 0 ? 1.0 : -1.0));
    State x{};
    for (std::size_t i = 0; i < states; ++i) x[i] = e.x0[i];

    const Spool spool(constants, e);
    if (first_of_its_kind) first_step[0] = first_step[1] = 0.0;
    piece(cylinder, spool.opens_a, x, spool.first, first_step[0]);
    if (spool.crosses) piece(cylinder, !spool.opens_a, x, e.dt - spool.first, first_step[1]);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t n = 0; n < size; ++n) y[i * size + n] = lane(x[n], i);
    steps += attempts * static_cast<long>(count);
    attempts = 0;
  }

  // Solve the experiments rows[0], rows[1], ..., at most one per lane, whose spools take the same sides; every piece has the
  // length one.
  void solve_side_by_side(const long* rows, std::size_t count, const double* experiments, const double* theta, double* y) {
    T parameters_of[parameters], input, motion, span[2];
    State x{};
    bool opens_a = false, crosses = false;
    for (std::size_t i = 0; i < lanes<T>; ++i) {
      const long k = rows[std::min(i, count - 1)];
      const double* const row = experiments + 7 * k;
      const Experiment e{row, row[5], row[6]};
      const Spool spool(constants, e);
      for (std::size_t j = 0; j < parameters; ++j) lane(parameters_of[j], i) = theta[k * parameters + j];
      for (std::size_t n = 0; n < states; ++n) lane(x[n], i) = e.x0[n];
      lane(input, i) = e.u;
      lane(motion, i) = e.x0[1] > 0 ? 1.0 : -1.0;
      lane(span[0], i) = spool.first;
      lane(span[1], i) = e.dt - spool.first;
      opens_a = spool.opens_a, crosses = spool.crosses;
    }
    const Cylinder<T> cylinder(constants, parameters_of, input, motion);
    piece(cylinder, opens_a, x, 1.0, first_step[0], &span[0]);
    if (crosses) piece(cylinder, !opens_a, x, 1.0, first_step[1], &span[1]);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t n = 0; n < size; ++n) y[rows[i] * size + n] = lane(x[n], i);
    steps += attempts * static_cast<long>(count);
    attempts = 0;
  }

  long steps = 0;

 private:
  using Stepper = odeint::runge_kutta_cash_karp54<State, double, State, double, odeint::array_algebra,
                                                  odeint::default_operations, odeint::never_resizer>;
  using Checker = ErrorChecker<T, size>;
  using Adjuster = odeint::default_step_adjuster<double, double>;

  void piece(const Cylinder<T>& cylinder, bool opens_a, State& x, double span, double& first, const T* unit = nullptr) {
    const auto with = [&](auto equation) {
      if (unit)
        advance(Scaled<T, decltype(equation)>{equation, *unit}, x, span, first);
      else
        advance(equation, x, span, first);
    };
    if (opens_a)
      with(Equation<T, true>{cylinder});
    else
      with(Equation<T, false>{cylinder});
  }

  void advance(auto equation, State& x, double span, double& first) {
    double t = 0.0, dt = first > 0 ? first : span / 8, accepted = 0.0;
    while (t < span && attempts < 100000) {
      dt = std::min(dt, span - t);
      const bool last = dt == span - t;
      const double tried = dt;
      ++attempts;
      if (stepper.try_step(equation, x, t, dt) != odeint::success) continue;
      if (accepted == 0) accepted = tried;
      if (last) break;
    }
    first = accepted;
  }

  Constants constants;
  odeint::controlled_runge_kutta<Stepper, Checker, Adjuster, odeint::never_resizer> stepper;
  double first_step[2] = {0.0, 0.0};
  long attempts = 0;
};

// Experiments (K, 7) as x0, u, dt; theta (K, 9); y (K, size). Runs of equal experiments share packs. Returns all steps.
template <class T, template <class, bool> class Equation>
long solve_all(const double* constants, long count, const double* experiments, const double* theta, double rtol,
               const double* scales, double* y) {
  Constants c;
  static_assert(sizeof c == 7 * sizeof(double));
  std::memcpy(&c, constants, sizeof c);
  Solver<T, Equation> solver(c, rtol, scales);
  bool fresh = true;
  for (long k = 0; k < count;) {
    const double* row = experiments + 7 * k;
    long n = 1;
    const long most = std::min<long>(lanes<T>, count - k);
    while (n < most && std::memcmp(row, row + 7 * n, 7 * sizeof(double)) == 0) ++n;
    solver.solve({row, row[5], row[6]}, theta + parameters * k, n, fresh, y + solver.size * k);
    k += n;
    fresh = k < count && std::memcmp(row, experiments + 7 * k, 7 * sizeof(double)) != 0;
  }
  return solver.steps;
}

// The same for experiments that differ: those whose spools take the same sides share packs, in the order of their durations, or
// as they come.
template <class T, template <class, bool> class Equation, bool sorted = true>
long solve_side_by_side(const double* constants, long count, const double* experiments, const double* theta, double rtol,
                        const double* scales, double* y) {
  Constants c;
  std::memcpy(&c, constants, sizeof c);
  std::vector<long> kinds[4];
  for (long k = 0; k < count; ++k) {
    const double* row = experiments + 7 * k;
    const Spool spool(c, {row, row[5], row[6]});
    kinds[2 * spool.opens_a + spool.crosses].push_back(k);
  }
  long steps = 0;
  for (std::vector<long>& kind : kinds) {
    if (sorted)
      std::stable_sort(kind.begin(), kind.end(),
                       [&](long a, long b) { return experiments[7 * a + 6] < experiments[7 * b + 6]; });
    Solver<T, Equation> solver(c, rtol, scales);
    for (std::size_t k = 0; k < kind.size(); k += lanes<T>)
      solver.solve_side_by_side(&kind[k], std::min(lanes<T>, kind.size() - k), experiments, theta, y);
    steps += solver.steps;
  }
  return steps;
}

extern "C" {
long states_scalar(const double* c, long n, const double* e, const double* theta, double rtol, const double* scales,
                   double* y) {
  return solve_all<double, StateEquation>(c, n, e, theta, rtol, scales, y);
}
long states_packs(const double* c, long n, const double* e, const double* theta, double rtol, const double* scales, double* y) {
  return solve_all<Pack, StateEquation>(c, n, e, theta, rtol, scales, y);
}
long sensitivities_scalar(const double* c, long n, const double* e, const double* theta, double rtol, const double* scales,
                          double* y) {
  return solve_all<double, VariationalEquation>(c, n, e, theta, rtol, scales, y);
}
long sensitivities_packs(const double* c, long n, const double* e, const double* theta, double rtol, const double* scales,
                         double* y) {
  return solve_side_by_side<Pack, VariationalEquation>(c, n, e, theta, rtol, scales, y);
}
long sensitivities_packs_as_given(const double* c, long n, const double* e, const double* theta, double rtol,
                                  const double* scales, double* y) {
  return solve_side_by_side<Pack, VariationalEquation, false>(c, n, e, theta, rtol, scales, y);
}
}
