#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"
#include "rows_and_columns.hpp"
#include "tape_integrator.hpp"

using namespace fisherpoint;
using namespace fisherpoint::testing;
using Narrow = Pack<native_lanes>;
using Wide = Pack<tape_lanes>;
using O = Operation;

namespace {

// The ball of models.hpp as lists of operations. Registers: the literals 0, 1, floor, -1; g, k; u; s, v; side; ds, dv; then
// what is computed. With `pole` the height is a denominator's value, which may have either sign.
TapeModel ball(Kind kind, double floor, bool pole = false) {
  enum { zero, one, bottom, minus, g, k, u, s, v, side, ds, dv, free };  // a limit has no side
  const bool kink = kind == Kind::kink;
  const int shift = kind == Kind::limit ? -1 : 0, ds_at = ds + shift, first = free + shift;
  const std::vector<double> literals = {0.0, 1.0, floor, -1.0};
  const int height = first, above = first + 1, minus_g = first + 2, minus_k = first + 3, fall = first + 4, slope = first + 5,
            minus_above = first + 6, registers = first + 7;
  Program rates{literals, {{O::neg, minus_g, g, 0, 0}}, {}, {v, minus_g}, registers};
  Program rate_jacobian{literals, {{O::neg, minus_g, g, 0, 0}}, {}, {v, minus_g, one, minus}, registers};
  Program state_jacobian{literals, {}, {}, {one}, registers};
  std::vector<Entry> entries = {{0, 1}, {1, 2}}, state_entries = {{0, 1}};
  if (kink) {
    rates.stage = {
        {O::sub, height, s, bottom, 0}, {O::select, above, side, height, zero}, {O::sub_mul, fall, k, above, minus_g}};
    rates.outputs[1] = fall;
    rate_jacobian.setup.push_back({O::neg, minus_k, k, 0, 0});
    rate_jacobian.stage = rates.stage;
    rate_jacobian.stage.push_back({O::select, slope, side, minus_k, zero});
    rate_jacobian.stage.push_back({O::neg, minus_above, above, 0, 0});
    rate_jacobian.outputs = {v, fall, one, slope, minus, minus_above};
    entries = {{0, 1}, {1, 0}, {1, 2}, {1, 3}};
    state_jacobian.setup.push_back({O::neg, minus_k, k, 0, 0});
    state_jacobian.stage = {{O::select, slope, side, minus_k, zero}};
    state_jacobian.outputs = {one, slope};
    state_entries.push_back({1, 0});
  }
  const Program surfaces{literals, {}, {{O::sub, height, s, bottom, 0}}, {height}, registers};
  const Shape<TapeModel> shape{2, 1, 1, 2, kind == Kind::jump, kind != Kind::limit, kind != Kind::limit || pole, 1};
  return TapeModel(shape, {1.0, 1.0},
                   {rates,
                    {literals, {}, {}, {s}, registers},
                    surfaces,
                    {literals, {}, {}, {ds_at}, registers},
                    state_jacobian,
                    rate_jacobian,
                    {literals, {}, {}, {s, one}, registers},
                    kind == Kind::jump ? Program{literals, {}, surfaces.stage, {height, one}, registers}
                                       : Program{literals, {}, {}, {}, registers}},
                   state_entries, entries, {{0, 0}}, std::vector<Entry>(kind == Kind::jump, Entry{0, 0}),
                   {{true, true},
                    {true},
                    std::vector<bool>(kind != Kind::limit, true),
                    std::vector<bool>(kind == Kind::jump, true),
                    std::vector<bool>(kind != Kind::limit, false),
                    std::vector<bool>(kind != Kind::limit, false),
                    std::vector<bool>(kind == Kind::limit && !pole, false),
                    kink ? std::vector{true, false, true, false} : std::vector{true, true}});
}

struct Throws {
  std::vector<double> x0, u, dt, theta;
  Points points() const { return {dt.size(), x0.data(), u.data(), dt.data()}; }
  Parameters parameters() const { return {theta.data(), true}; }

  explicit Throws(int count, double floor) {
    for (int i = 0; i < count; ++i) {
      const double t = (i + 0.5) / count, wave = std::sin(40 * t);
      x0.push_back(floor - 1.0 + 0.7 * wave);
      x0.push_back(3.0 * t);
      u.push_back(0.0);
      dt.push_back(0.2 + 2.0 * std::abs(std::cos(31 * t)));
      theta.push_back(2.0 + wave);
      theta.push_back(4.0 + 3 * t);
    }
  }
};

struct Results {
  std::vector<double> x, y, dx, dy;
  std::vector<Status> status;
};
template <class P, class Method, class M>
Results sensitive(const M& model, const Throws& throws, MethodName method = MethodName::DOP853) {
  const std::size_t n = throws.dt.size();
  Results r{std::vector<double>(2 * n), std::vector<double>(n), std::vector<double>(4 * n), std::vector<double>(2 * n),
            std::vector<Status>(n)};
  sensitivity_packs<P, Method>(model, throws.points(), throws.parameters(), {.method = method}, Workers(1),
                               {r.x.data(), r.y.data(), r.dx.data(), r.dy.data(), r.status.data()});
  return r;
}

void check_same(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(a[i] == doctest::Approx(b[i]).epsilon(1e-11));
}

template <Kind kind, class Method>
void check_against_compiled(MethodName method) {
  const double floor = 0.3;
  const Throws throws(61, floor);
  const Results compiled = sensitive<Narrow, Method>(Ball<kind>{floor}, throws, method);
  const Results wide = sensitive<Wide, Tableau>(ball(kind, floor), throws, method);
  CHECK(wide.status == compiled.status);
  if (kind == Kind::jump) CHECK(std::count(wide.status.begin(), wide.status.end(), Status::met_jump) > 10);
  check_same(wide.x, compiled.x);
  check_same(wide.y, compiled.y);
  check_same(wide.dx, compiled.dx);
  check_same(wide.dy, compiled.dy);
}

}  // namespace

TEST_CASE("a tape's trajectories, sensitivities and statuses are the compiled model's") {
  check_against_compiled<Kind::kink, DormandPrince853>(MethodName::DOP853);
  check_against_compiled<Kind::jump, DormandPrince853>(MethodName::DOP853);
  check_against_compiled<Kind::kink, DormandPrince>(MethodName::RK45);
}

TEST_CASE("a tape's rows are its columns, to rounding") {
  const TapeModel model = ball(Kind::kink, 0.3);
  for (const Tolerance& tolerance : {Tolerance{.method = MethodName::RK45}, Tolerance{.method = MethodName::DOP853}})
    for (const int steps : {1, 5}) {
      CHECK(difference_of_rows<Narrow, Tableau>(model, {{0.7, 2.1}, {0.0}, {3.0, 5.0}, {1.0}}, 0.5, steps, tolerance) < 1e-12);
      CHECK(difference_of_rows<Wide, Tableau>(model, {{0.7, 2.1}, {0.0}, {3.0, 5.0}, {1.0}}, 0.5, steps, tolerance) < 1e-12);
    }
}

TEST_CASE("a point's result does not depend on what shares its pack, to the last bit") {
  const TapeModel model = ball(Kind::kink, 0.3);
  const Throws throws(61, 0.3);
  const Results all = sensitive<Wide, Tableau>(model, throws);
  for (const std::size_t k : {0, 17, 60}) {
    Throws one(1, 0.3);
    one.x0 = {throws.x0[2 * k], throws.x0[2 * k + 1]};
    one.dt = {throws.dt[k]};
    one.theta = {throws.theta[2 * k], throws.theta[2 * k + 1]};
    const Results alone = sensitive<Wide, Tableau>(model, one);
    CHECK(alone.status[0] == all.status[k]);
    for (int i = 0; i < 2; ++i) CHECK(alone.x[i] == all.x[2 * k + i]);
    for (int i = 0; i < 4; ++i) CHECK(alone.dx[i] == all.dx[4 * k + i]);
  }
}

TEST_CASE("a tape's predictive covariances are the compiled model's") {
  const double floor = 0.3, mean[2] = {2.0, 4.0}, u = 0.0, dt = 1.1;
  const PriorGrid grid({cells(2.0, 0.2, 7, 1.5), cells(4.0, 0.4, 5, 1.5)});
  for (const double v : {0.3, 1.9, 3.0}) {
    const double x0[2] = {floor - 0.5, v};
    double covariance[2], lost[2];
    Status status[2];
    std::int64_t redone[2];
    const auto run = [&]<class P, class Method>(const auto& model, int k) {
      predictive_covariance_packs<P, Method>(model, {1, x0, &u, &dt}, mean, grid, 0.0, Tolerance{}, Workers(1),
                                             {&covariance[k], &status[k], &redone[k], &lost[k]});
    };
    run.operator()<Narrow, DormandPrince853>(Ball<Kind::kink>{floor}, 0);
    run.operator()<Wide, Tableau>(ball(Kind::kink, floor), 1);
    CHECK(status[0] == Status::ok);
    CHECK(status[1] == Status::ok);
    CHECK(redone[1] == redone[0]);
    CHECK(covariance[1] == doctest::Approx(covariance[0]).epsilon(1e-9));
  }
}

TEST_CASE("a limit forbids one side, a pole only the change of sides") {
  const double theta[2] = {2.0, 0.0}, u = 0.0, dt = 0.4, floor = 0.3;
  const auto status = [&](const TapeModel& model, double s, double v) {
    const double x0[2] = {s, v};
    double x[2], y, lasted;
    Status result;
    simulate_packs<Narrow, Tableau>(model, {1, x0, &u, &dt}, {theta, false}, Tolerance{}, Workers(1),
                                    {x, &y, &result, &lasted});
    return result;
  };
  const TapeModel limit = ball(Kind::limit, floor), pole = ball(Kind::limit, floor, true);
  CHECK(status(limit, floor + 1, 0.0) == Status::ok);
  CHECK(status(limit, floor - 1, 0.0) == Status::left_domain);
  CHECK(status(limit, floor + 0.01, -1.0) == Status::left_domain);
  CHECK(status(pole, floor + 1, 0.0) == Status::ok);
  CHECK(status(pole, floor - 1, 0.0) == Status::ok);
  CHECK(status(pole, floor, 0.0) == Status::left_domain);
  CHECK(status(pole, floor + 0.01, -1.0) == Status::left_domain);
  CHECK(status(pole, floor - 0.01, 2.0) == Status::left_domain);
}

TEST_CASE("lists that would read or write what they must not are refused") {
  const Shape<TapeModel> shape{1, 0, 1, 1, 0, 0, 0, 0};
  const auto model = [&](const Program& rates) {
    const Program none{{}, {}, {}, {}, 3}, x{{}, {}, {}, {1}, 3}, jacobian{{}, {}, {}, {1, 0}, 3};
    return TapeModel(shape, {1.0}, {rates, x, none, none, none, jacobian, {{}, {}, {}, {1, 1}, 3}, none}, {}, {{0, 1}},
                     {{0, 0}}, {}, {{true}, {true}, {}, {}, {}, {}, {}, {false}});
  };
  // theta, x, dx, then what is computed.
  CHECK_NOTHROW(model({{}, {}, {{O::mul, 3, 0, 1, 0}}, {3}, 4}));
  CHECK_THROWS_AS(model({{}, {}, {{O::mul, 4, 0, 1, 0}}, {4}, 4}), std::invalid_argument);   // no such register
  CHECK_THROWS_AS(model({{}, {}, {{O::mul, 0, 0, 1, 0}}, {0}, 4}), std::invalid_argument);   // a leaf
  CHECK_THROWS_AS(model({{}, {}, {{O::mul, 3, 0, -1, 0}}, {3}, 4}), std::invalid_argument);  // out of range
  CHECK_THROWS_AS(model({{}, {}, {{O::mul, 3, 0, 4, 0}, {O::mul, 4, 0, 1, 0}}, {3}, 5}),
                  std::invalid_argument);                                                                       // not yet known
  CHECK_THROWS_AS(model({{}, {{O::mul, 3, 1, 1, 0}}, {}, {3}, 4}), std::invalid_argument);                      // setup reads x
  CHECK_THROWS_AS(model({{}, {{O::mul, 3, 0, 0, 0}}, {{O::mul, 3, 3, 1, 0}}, {3}, 4}), std::invalid_argument);  // spoils it
  CHECK_THROWS_AS(model({{}, {}, {{O::count, 3, 0, 1, 0}}, {3}, 4}), std::invalid_argument);
  CHECK_THROWS_AS(model({{}, {}, {{O::mul, 3, 0, 1, 0}}, {3, 3}, 4}), std::invalid_argument);
}

TEST_CASE("the first part of a machine alone has the same bits, and the others are left as they were at first") {
  const TapeModel model = ball(Kind::kink, 0.4);
  HeapArray<Wide> theta(2), u(1), x(2), side(1);
  const auto vary = [](HeapArray<Wide>& values, double from) {
    for (Wide& value : values)
      for (int lane = 0; lane < Wide::width; ++lane) value.set(lane, from += 0.37);
  };
  vary(theta, 0.1), vary(u, -1.0), vary(x, -2.0);
  side.fill(Wide(1.0));
  Machine<Wide> all(model.programs().rate_jacobian, model.shape(), theta, u);
  Machine<Wide> first(model.programs().rate_jacobian, model.shape(), theta, u, true);
  all.run(x, side), first.run(x, side);
  std::vector<Wide> before;
  for (int i = 0; i < 6; ++i) before.push_back(first.output(i));
  vary(x, 1.0);
  all.run(x, side), first.run(x, side);
  for (const int i : {1, 3, 5})  // what is computed; the others are leaves
    for (int lane = 0; lane < Wide::width; ++lane)
      CHECK(first.output(i)[lane] == (lane < native_lanes ? all.output(i)[lane] : before[i][lane]));
}

TEST_CASE("sums are marked where one register has them and nothing else reads them before they are whole") {
  enum { a, b, c, sum, other };
  const auto marks = [](std::vector<Instruction> instructions) {
    mark_sums(instructions);
    std::vector<std::pair<int, int>> found;  // where, and of how many operations
    for (int k = 0; k < static_cast<int>(instructions.size()); ++k)
      if (instructions[k].operation == O::accumulate) found.emplace_back(k, instructions[k].a);
    return found;
  };
  const auto one = std::vector<std::pair<int, int>>{{0, 3}};
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul_add, sum, b, c, sum}, {O::sub, sum, sum, a, 0}}) == one);
  CHECK(marks({{O::sub, sum, sum, b, 0}, {O::sub_mul, sum, b, c, sum}, {O::add, sum, sum, a, 0}}) ==
        one);                                                                      // reads what was there
  CHECK(marks({{O::div, sum, a, b, 0}, {O::mul_add, sum, b, c, sum}}).empty());    // begins with another operation
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul_add, sum, sum, c, sum}}).empty());  // as a factor too
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::add, sum, sum, sum, 0}}).empty());
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::add, sum, a, sum, 0}}).empty());  // the list has sums first
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::sub, sum, a, sum, 0}}).empty());
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul_sub, sum, b, c, sum}}).empty());  // is less the sum
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul_add, other, b, c, sum}}).empty());
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul, other, b, c, 0}, {O::mul_add, sum, b, c, sum}}).empty());
  const auto two = std::vector<std::pair<int, int>>{{0, 2}, {3, 2}};
  CHECK(marks({{O::mul, sum, a, b, 0}, {O::mul_add, sum, b, c, sum}, {O::mul, sum, b, b, 0}, {O::sub, sum, sum, c, 0}}) == two);
}

TEST_CASE("a sum that is kept at hand is what its operations give one by one") {
  // Registers: theta; x; dx; then a sum, in which terms of every kind meet, and what is made of it.
  enum { k, d, x, y, dx, dy, sum, product, whole, registers };
  const auto machine_of = [&](bool marked) {
    Program program{{},
                    {},
                    {{O::mul, product, k, x, 0},
                     {O::mul_sub, sum, d, y, x},
                     {O::mul_add, sum, k, y, sum},
                     {O::sub_mul, sum, product, x, sum},
                     {O::sub, sum, sum, y, 0},
                     {O::add, sum, sum, product, 0},
                     {O::mul, whole, sum, sum, 0},
                     {O::sub_mul, whole, d, x, whole}},
                    {sum, whole},
                    registers};
    if (marked) mark_sums(program.stage);
    return program;
  };
  const auto values = [](double start) {
    HeapArray<Wide> of(2);
    for (int i = 0; i < 2; ++i)
      for (int lane = 0; lane < Wide::width; ++lane) lanes_of<Wide>::set(of[i], lane, start + 0.37 * i + 0.11 * lane * lane);
    return of;
  };
  const Shape<TapeModel> shape{2, 0, 0, 2, 0, 0, 0, 0};
  const HeapArray<Wide> theta = values(0.3), at = values(-1.7), side(0), u(0);
  const Program plain = machine_of(false), marked = machine_of(true);
  REQUIRE(marked.stage.size() == plain.stage.size() + 2);
  for (const int parts : {1, PartsOf<Wide>::count}) {
    Machine<Wide> one(plain, shape, theta, u, parts), other(marked, shape, theta, u, parts);
    HeapArray<Wide> out(2), other_out(2);
    for (int run = 0; run < 2; ++run) {  // the second time on the parts in use alone
      one.run(at, side, out);
      other.run(at, side, other_out);
      for (int i = 0; i < 2; ++i)
        for (int lane = 0; lane < Wide::width; ++lane)
          CHECK(lanes_of<Wide>::get(out[i], lane) == lanes_of<Wide>::get(other_out[i], lane));
    }
  }
}
