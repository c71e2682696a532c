// The inner loops take no memory: what is counted here is every block that this program asks of the system.
#include <doctest/doctest.h>
#include <malloc.h>

#include <atomic>
#include <cerrno>
#include <vector>

#include "fisherpoint/integration/plan.hpp"
#include "fisherpoint/kernels/fisher_accumulator.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/prior/prior_grid.hpp"
#include "models.hpp"

#if defined(__GLIBC__) && !defined(FISHERPOINT_SANITIZED)

static std::atomic<long> taken{0};

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t n) { return ++taken, __libc_malloc(n); }
void* calloc(std::size_t n, std::size_t size) { return ++taken, __libc_calloc(n, size); }
void* realloc(void* at, std::size_t n) { return ++taken, __libc_realloc(at, n); }
void* memalign(std::size_t alignment, std::size_t n) { return ++taken, __libc_memalign(alignment, n); }
void* aligned_alloc(std::size_t alignment, std::size_t n) { return memalign(alignment, n); }
int posix_memalign(void** at, std::size_t alignment, std::size_t n) {
  *at = memalign(alignment, n);
  return *at ? 0 : ENOMEM;
}
}

using namespace fisherpoint;
using namespace fisherpoint::testing;
using P = Pack<native_lanes>;
using Method = DormandPrince853;

namespace {

long taken_by(auto&& work) {
  const long before = taken;
  work();
  return taken - before;
}

}  // namespace

TEST_CASE("what is counted is taken") {
  CHECK(taken_by([] { std::vector<double> values(100); }) == 1);
  CHECK(taken_by([] { Shelves::drop(Shelves::take(64), 64); }) == 1);
  CHECK(taken_by([] { Matrix values(9, 9); }) == 1);
}

TEST_CASE("steps take no memory, over kinks and with rejections") {
  using Equation = StateEquation<HydraulicCylinder, P>;
  Equation::Theta theta;
  Equation::State start, x;
  set_lanes(theta, cylinder_theta.data());
  set_lanes(start, std::array{0.25, 0.15, 10e6, 11e6, -0.16}.data());
  const Equation equation(HydraulicCylinder{}, theta, {P(0.3)});
  int attempts = 0;
  const auto integrated = [&](auto method, const Tolerance& tolerance) {
    return taken_by([&] {
      x = start;
      attempts = Integrator<Equation, decltype(method)>(equation, tolerance).run(x, P(5e-3), P(5e-3)).attempts;
    });
  };
  CHECK(integrated(Method{}, {}) == 0);
  CHECK(integrated(DormandPrince{}, {.relative = 1e-10}) == 0);
  CHECK(attempts > 20);
}

TEST_CASE("a piston that sticks and breaks away takes no memory") {
  using Equation = StateEquation<HydraulicCylinder, P>;
  Equation::Theta theta;
  Equation::State x;
  set_lanes(theta, cylinder_theta.data());
  const Equation equation(HydraulicCylinder{}, theta, {P(0.0)});
  Outcome<P> outcome;
  const auto taken_until = [&](double duration) {
    return taken_by([&] {
      set_lanes(x, std::array{0.15, 0.0, 6e6, 6e6 * HydraulicCylinder{}.A_A / HydraulicCylinder{}.A_B, 0.1}.data());
      const Tolerance tolerance{.relative = 1e-9, .cross_jumps = true};
      outcome = Integrator<Equation, Method>(equation, tolerance).run(x, P(duration), P(0.0));
    });
  };
  CHECK(taken_until(2e-4) == 0);
  CHECK(std::abs(x[1][0]) < 1e-12);
  CHECK(taken_until(2e-3) == 0);
  CHECK(std::abs(x[1][0]) > 1e-3);
  CHECK(outcome.status[0] == Status::ok);
  CHECK(outcome.attempts > 5);
}

TEST_CASE("implicit steps take memory once, however many there are") {
  using Equation = StateEquation<HydraulicCylinder, P>;
  Equation::Theta theta;
  Equation::State x;
  set_lanes(theta, cylinder_theta.data());
  const Equation equation(HydraulicCylinder{}, theta, {P(0.3)});
  std::array<int, 2> attempts{};
  const auto taken_for = [&](double duration, int& tries) {
    return taken_by([&] {
      set_lanes(x, std::array{0.25, 0.15, 10e6, 11e6, -0.16}.data());
      const Tolerance tolerance{.relative = 1e-8, .method = MethodName::Radau};
      tries = Integrator<Equation, Method>(equation, tolerance).run(x, P(duration), P(0.0)).attempts;
    });
  };
  CHECK(taken_for(1e-4, attempts[0]) == taken_for(2e-2, attempts[1]));
  CHECK(attempts[1] > 3 * attempts[0]);
}

TEST_CASE("rows go back without taking memory, from the second pack on") {
  using Equation = VariationalEquation<HydraulicCylinder, P>;
  Equation::Theta theta;
  Equation::State start;
  set_lanes(theta, cylinder_theta.data());
  set_lanes(start, std::array{0.25, 0.15, 10e6, 11e6, -0.16}.data());
  const Equation equation(HydraulicCylinder{}, theta, {P(0.3)});
  const Shelves shelves;
  const auto there_and_back = [&] {
    Adjoints<HydraulicCylinder, P, Method> adjoints(equation, start, {});
    for (int n = 0; n < 40; ++n) adjoints.advance(P(5e-5), {P(1.0), P(-1.0)});
    Adjoints<HydraulicCylinder, P, Method>::Rows rows;
    rows.push_back(adjoints.row());
    adjoints.back(rows);
  };
  CHECK(taken_by(there_and_back) < 50);  // none where an earlier work of the thread has left some
  CHECK(taken_by(there_and_back) == 0);
}

TEST_CASE("more nodes of a prior take no more memory") {
  std::vector<Axis> axes;
  for (const double mean : cylinder_theta) axes.push_back(cells(mean, 0.1 * mean, 3, 1.5));
  const PriorGrid grid(axes);
  const HydraulicCylinder model;
  const double x0[] = {0.25, 0.15, 10e6, 11e6, -0.16}, u[] = {0.3};
  const Pilots pilots(cylinder_theta.data(), grid);
  PointOverPrior<HydraulicCylinder> point{x0, u, 1.4e-3, 0.0, std::nullopt, {}};
  REQUIRE(prepare<P, Method>(model, pilots, {}, point) == Status::ok);
  REQUIRE(point.plan);
  std::int64_t redone = 0;
  const auto over = [&](std::size_t nodes) {
    return taken_by([&] {
      const Shelves shelves;
      redone = SumOverNodes<P, Method, HydraulicCylinder>(model, point, {}, true).over(grid, 0, nodes, nullptr).redone;
    });
  };
  const long few = over(512);
  CHECK(few < 20);
  CHECK(over(8192) <= few);  // what the first work has taken is kept
  CHECK(redone == 0);
  point.plan.reset();
  CHECK(over(1024) <= few);
  CHECK(redone == 1024);
}

TEST_CASE("points that are added to the accumulator, or asked about, take no memory") {
  constexpr int n_y = 4, p = 9, count = 50;
  const Matrix s = Matrix::Random(count, n_y * p), d = Matrix::Identity(n_y, n_y);
  Matrix c(count, n_y * n_y);
  for (int k = 0; k < count; ++k) c.row(k) = d.reshaped<Eigen::RowMajor>().transpose();
  FisherAccumulator f(n_y, p);
  CHECK(taken_by([&] {
          for (int k = 0; k < count; ++k) f.add(s.row(k).data(), c.row(k).data());
        }) == 0);
  for (const bool pooled : {false, true}) {
    const OutputCovariance covariance{d, pooled};
    double out[count];
    const auto asked = [&](int n) {
      return taken_by([&] { f.log_det_changed(1, n, s.data(), c.data(), covariance, 0.1, 0, out); });
    };
    CHECK(asked(1) == asked(count));
  }
}

#endif
