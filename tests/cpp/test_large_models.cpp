#include <doctest/doctest.h>

#include <Eigen/Core>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>
#include <vector>

#include "tape_integrator.hpp"

using namespace fisherpoint;
using P = Pack<tape_lanes>;
using O = Operation;
using State = HeapArray<P>;

namespace {

// x' = A x + b as lists of operations, with the entries of A that are not zero.
TapeModel linear(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  const int n = static_cast<int>(a.rows());
  std::vector<double> literals = {0.0};
  std::vector<Entry> entries;
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      if (a(i, k) != 0.0) entries.push_back({i, k}), literals.push_back(a(i, k));
  const int of_b = static_cast<int>(literals.size());
  for (int i = 0; i < n; ++i) literals.push_back(b[i]);
  const int x = static_cast<int>(literals.size()), first = x + 2 * n, registers = first + n;
  Program rates{literals, {}, {}, {}, registers}, jacobian = rates, slopes = rates;
  for (int i = 0; i < n; ++i) rates.outputs.push_back(first + i);
  std::vector<int> begun(n, 0);
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const auto [i, k] = entries[e];
    rates.stage.push_back({O::mul_add, first + i, static_cast<int>(e) + 1, x + k, begun[i]++ ? first + i : of_b + i});
    slopes.outputs.push_back(static_cast<int>(e) + 1);
  }
  jacobian.stage = rates.stage;
  jacobian.outputs = rates.outputs;
  jacobian.outputs.insert(jacobian.outputs.end(), slopes.outputs.begin(), slopes.outputs.end());
  const Program none{literals, {}, {}, {}, registers}, output{literals, {}, {}, {x}, registers};
  return TapeModel({n, 0, 1, 0, 0, 0, 0, 0}, std::vector<double>(n, 1.0),
                   {rates, output, none, none, slopes, jacobian, output, none}, entries, entries, {}, {},
                   {std::vector<bool>(n, false), {false}, {}, {}, {}, {}, {}, std::vector<bool>(entries.size(), true)});
}

struct Ends {
  std::vector<Eigen::VectorXd> x;  // of every lane
  Outcome<P> outcome;
};
// From the same start in all lanes, over durations that differ by 2 %.
Ends follow(const TapeModel& model, const Eigen::VectorXd& start, double duration, double rtol, int used = P::width) {
  const StateEquation<TapeModel, P> f(model, HeapArray<P>(0), HeapArray<P>(0), used);
  const Tolerance tolerance{.relative = rtol};
  Integrator<StateEquation<TapeModel, P>, Tableau> integrator(f, tolerance);
  State y(f.states);
  for (int i = 0; i < f.states; ++i) y[i] = P(start[i]);
  P until(0.0);
  for (int lane = 0; lane < used; ++lane) until.set(lane, duration * (1.0 + 0.02 * lane / P::width));
  Ends ends;
  ends.outcome = integrator.run(y, until, P(0.0));
  for (int lane = 0; lane < used; ++lane) {
    ends.x.emplace_back(f.states);
    for (int i = 0; i < f.states; ++i) ends.x.back()[i] = y[i][lane];
  }
  return ends;
}

// Masses between springs, the first one held, the last one pulled; positions, then speeds.
Eigen::MatrixXd masses(int count) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * count, 2 * count);
  for (int i = 0; i < count; ++i) {
    a(i, count + i) = 1.0;
    a(count + i, i) = i + 1 < count ? -8.0 : -4.0;
    if (i > 0) a(count + i, i - 1) = 4.0;
    if (i + 1 < count) a(count + i, i + 1) = 4.0;
  }
  return a;
}

// Cells in which something diffuses, the last one open.
Eigen::MatrixXd cells(int count) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(count, count);
  for (int i = 0; i < count; ++i) {
    a(i, i) = i > 0 ? -2.0 : -1.0;
    if (i > 0) a(i, i - 1) = 1.0;
    if (i + 1 < count) a(i, i + 1) = 1.0;
  }
  return count * count * a;
}

void check_ends(const Ends& ends, const Eigen::MatrixXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& start,
                double duration, double within) {
  const int n = static_cast<int>(a.rows());
  Eigen::MatrixXd whole = Eigen::MatrixXd::Zero(n + 1, n + 1);
  whole.topLeftCorner(n, n) = a;
  whole.topRightCorner(n, 1) = b;
  Eigen::VectorXd from(n + 1);
  from << start, 1.0;
  for (std::size_t lane = 0; lane < ends.x.size(); ++lane) {
    CHECK(ends.outcome.status[lane] == Status::ok);
    const Eigen::MatrixXd over = (duration * (1.0 + 0.02 * static_cast<double>(lane) / P::width) * whole).exp();
    CHECK((ends.x[lane] - (over * from).head(n)).cwiseAbs().maxCoeff() < within);
  }
}

}  // namespace

TEST_CASE("a large model at rest begins with a step that its rates allow, and ends without a short one") {
  const Eigen::MatrixXd a = masses(20);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(40), start = b;
  b[39] = 1.0;
  const TapeModel model = linear(a, b);
  REQUIRE(model.orders().of_states());
  for (const auto& [rtol, tries] : {std::pair{1e-3, 11}, {1e-6, 19}, {1e-9, 36}}) {  // from a far shorter step they are more
    CAPTURE(rtol);
    const Ends ends = follow(model, start, 5.0, rtol);
    check_ends(ends, a, b, start, 5.0, 10 * rtol);
    CHECK(ends.outcome.attempts <= tries);
    CHECK_FALSE(any(ends.outcome.stiff));
  }
}

TEST_CASE("a large stiff model goes over to implicit steps within few tries, in all lanes at once") {
  const Eigen::MatrixXd a = cells(60);
  const Eigen::VectorXd b = Eigen::VectorXd::Zero(60), start = Eigen::VectorXd::Ones(60);
  const TapeModel model = linear(a, b);
  REQUIRE(model.orders().of_states());
  for (const auto& [rtol, tries] : {std::pair{1e-3, 23}, {1e-6, 72}}) {
    CAPTURE(rtol);
    const Ends ends = follow(model, start, 0.1, rtol);
    check_ends(ends, a, b, start, 0.1, 10 * rtol);
    CHECK(ends.outcome.attempts <= tries);
    for (int lane = 0; lane < P::width; ++lane) CHECK(ends.outcome.stiff[lane]);
  }
}

TEST_CASE("lanes have the same bits whatever parts of a pack are in use") {
  for (const bool stiff : {false, true}) {
    const Eigen::MatrixXd a = stiff ? cells(40) : masses(20);
    const Eigen::VectorXd b = Eigen::VectorXd::Constant(40, 0.1), start = Eigen::VectorXd::LinSpaced(40, 0.0, 1.0);
    const TapeModel model = linear(a, b);
    const double duration = stiff ? 0.1 : 5.0;
    const Ends all = follow(model, start, duration, 1e-5);
    for (const int used : {1, native_lanes, native_lanes + 1, 3 * native_lanes}) {
      CAPTURE(used);
      const Ends some = follow(model, start, duration, 1e-5, used);
      for (int lane = 0; lane < used; ++lane) CHECK((some.x[lane].array() == all.x[lane].array()).all());
    }
  }
}
