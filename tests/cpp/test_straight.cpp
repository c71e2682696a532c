#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "fisherpoint/compiled/straight.hpp"
#include "fisherpoint/equations/tape_machine.hpp"

using namespace fisherpoint;
using P = Pack<tape_lanes>;

namespace {

constexpr int operations = static_cast<int>(Operation::count);

straight::V carried_out(Operation operation, straight::V a, straight::V b, straight::V c) {
  using O = Operation;
  switch (operation) {
#define FISHERPOINT_CASE(name, ...) \
  case O::name:                     \
    return straight::name(__VA_ARGS__);
    FISHERPOINT_CASE(add, a, b)
    FISHERPOINT_CASE(sub, a, b)
    FISHERPOINT_CASE(mul, a, b)
    FISHERPOINT_CASE(div, a, b)
    FISHERPOINT_CASE(neg, a)
    FISHERPOINT_CASE(mul_add, a, b, c)
    FISHERPOINT_CASE(mul_sub, a, b, c)
    FISHERPOINT_CASE(sub_mul, a, b, c)
    FISHERPOINT_CASE(sqrt, a)
    FISHERPOINT_CASE(exp, a)
    FISHERPOINT_CASE(log, a)
    FISHERPOINT_CASE(sin, a)
    FISHERPOINT_CASE(cos, a)
    FISHERPOINT_CASE(tan, a)
    FISHERPOINT_CASE(asin, a)
    FISHERPOINT_CASE(acos, a)
    FISHERPOINT_CASE(atan, a)
    FISHERPOINT_CASE(sinh, a)
    FISHERPOINT_CASE(cosh, a)
    FISHERPOINT_CASE(tanh, a)
    FISHERPOINT_CASE(pow, a, b)
    FISHERPOINT_CASE(abs, a)
    FISHERPOINT_CASE(sign, a)
    FISHERPOINT_CASE(min, a, b)
    FISHERPOINT_CASE(max, a, b)
    FISHERPOINT_CASE(select, a, b, c)
#undef FISHERPOINT_CASE
    case O::accumulate:
    case O::count:
      break;
  }
  return a;
}

// Of theta: a, b and c.
void none(const FisherpointLeaves*, double*, std::int32_t) {}
void every_operation(const FisherpointLeaves* leaves, double* own, std::int32_t used) {
  for (int lane = 0; lane < used; lane += native_lanes) {
    const double* const theta = leaves->theta + lane;
    const straight::V a = straight::load(theta, 0), b = straight::load(theta, 1), c = straight::load(theta, 2);
    for (int k = 0; k < operations; ++k) straight::store(own + lane, k, carried_out(static_cast<Operation>(k), a, b, c));
  }
}

// Every operation of theta, on registers behind it.
Program program() {
  Program all{{}, {}, {}, {}, 3 + operations};
  for (std::int32_t k = 0; k < operations; ++k) {
    all.stage.push_back({static_cast<Operation>(k), 3 + k, 0, 1, 2});
    all.outputs.push_back(3 + k);
  }
  return all;
}

bool same(double a, double b) { return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace

TEST_CASE("straight functions compute what lists do, to the last bit") {
  const FisherpointProgram functions{tape_lanes, register_bytes, operations, none, every_operation};
  const Program listed = program();
  Program called = program();
  called.straight = &functions;
  const Shape<TapeModel> shape{0, 0, 0, 3, 0, 0, 0, 0};
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> nice = {0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-310, 1e300, -1e300, infinity, -infinity, nan, 3.0};
  std::mt19937 draw(1);
  std::normal_distribution<double> normal;
  const auto number = [&] { return draw() % 3 == 0 ? nice[draw() % nice.size()] : normal(draw) * std::exp(normal(draw)); };
  HeapArray<P> theta(3), nothing(0);
  for (int round = 0; round < 2000; ++round) {
    for (P& pack : theta)
      for (int lane = 0; lane < P::width; ++lane) pack.set(lane, number());
    Machine<P> one(listed, shape, theta, nothing), other(called, shape, theta, nothing);
    one.run(nothing);
    other.run(nothing);
    for (int k = 0; k < operations; ++k)
      for (int lane = 0; lane < P::width; ++lane) {
        INFO(std::string(operation_names[k]) << " of " << theta[0][lane] << ", " << theta[1][lane] << ", " << theta[2][lane]);
        INFO(one.output(k)[lane] << " in a list, " << other.output(k)[lane] - one.output(k)[lane]
                                 << " more in a straight function");
        REQUIRE(same(one.output(k)[lane], other.output(k)[lane]));
      }
  }
}

TEST_CASE("functions for other packs are left alone") {
  for (const auto& [lanes, bytes] : {std::pair{2 * tape_lanes, register_bytes}, std::pair{tape_lanes, 2 * register_bytes}}) {
    const FisherpointProgram functions{lanes, bytes, 1, none, none};
    Program called{{}, {}, {{Operation::add, 3, 0, 1, 0}}, {3}, 4};
    called.straight = &functions;
    HeapArray<P> theta(3), nothing(0);
    theta.fill(P(1.5));
    Machine<P> machine(called, Shape<TapeModel>{0, 0, 0, 3, 0, 0, 0, 0}, theta, nothing);
    machine.run(nothing);
    CHECK(machine.output(0)[0] == 3.0);
  }
}

TEST_CASE("functions compute the vectors in use alone, once all lanes have values") {
  const FisherpointProgram functions{tape_lanes, register_bytes, operations, none, every_operation};
  Program called = program();
  called.straight = &functions;
  HeapArray<P> theta(3), nothing(0);
  for (int parts = 1; parts <= P::parts; ++parts) {
    theta.fill(P(1.5));
    Machine<P> machine(called, Shape<TapeModel>{0, 0, 0, 3, 0, 0, 0, 0}, theta, nothing, parts);
    machine.run(nothing);
    theta.fill(P(2.0));
    machine.run(nothing);
    const auto sum = machine.output(static_cast<int>(Operation::add));
    for (int lane = 0; lane < P::width; ++lane) CHECK(sum[lane] == (lane < parts * native_lanes ? 4.0 : 3.0));
  }
}
