#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "fisherpoint/numbers/eigenvalues.hpp"
#include "fisherpoint/numbers/elimination.hpp"
#include "fisherpoint/numbers/implicit_orders.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/linear_system.hpp"

using namespace fisherpoint;
using P = Pack<native_lanes>;

namespace {

constexpr int n = 6;

// Entries of either sign; of every other lane the diagonal is next to nothing, so that rows change places there.
double entry(int lane, int i, int k) {
  const double value = std::sin(7.3 * lane + 2.1 * i + 5.7 * k + 0.3 * i * k);
  return i == k && lane % 2 ? 1e-14 * value : value;
}
// As LinearSystem asks for them.
template <class T>
auto entries_of(const ShelfVector<T>& matrix) {
  return [&](int place) { return [&matrix, place](Part part) { return part(matrix[place]); }; };
}
double right(int lane, int i) { return std::cos(3.1 * lane + i); }

}  // namespace

TEST_CASE("elimination solves, in lanes whose rows change places and in others") {
  Elimination<P> system(n);
  ShelfVector<P> b(n);
  for (int lane = 0; lane < P::width; ++lane)
    for (int i = 0; i < n; ++i) {
      lanes_of<P>::set(b[i], lane, right(lane, i));
      for (int k = 0; k < n; ++k) lanes_of<P>::set(system(i, k), lane, entry(lane, i, k));
    }
  system.factorise();
  system.solve(b.data());
  for (int lane = 0; lane < P::width; ++lane) {
    Elimination<double> alone(n);
    ShelfVector<double> x(n);
    for (int i = 0; i < n; ++i) {
      x[i] = right(lane, i);
      for (int k = 0; k < n; ++k) alone(i, k) = entry(lane, i, k);
    }
    alone.factorise();
    alone.solve(x.data());
    for (int i = 0; i < n; ++i) {
      double sum = -right(lane, i);
      for (int k = 0; k < n; ++k) sum += entry(lane, i, k) * b[k][lane];
      CHECK(std::abs(sum) < 1e-12);
      CHECK(b[i][lane] == doctest::Approx(x[i]).epsilon(1e-10));
    }
  }
}

TEST_CASE("a system in an order is solved as a full one, in lanes whose rows change places too") {
  // A ring of unknowns with one that all read: elimination adds entries.
  constexpr int size = 30;
  std::vector<std::pair<int, int>> pattern;
  for (int i = 0; i < size; ++i) {
    pattern.emplace_back(i, (i + 1) % size);
    pattern.emplace_back(i, (i + 7) % size);
    if (i % 3 == 0) pattern.emplace_back(i, 4), pattern.emplace_back(4, i);
  }
  EliminationOrder order(size, pattern);
  CHECK(order.pays());
  order.find_targets();
  LinearSystem<P> real(size, &order), full(size, nullptr);
  LinearSystem<Complex<P>> complex(size, &order);
  CHECK(order.numbers < size * size);
  ShelfVector<P> of_real(real.places(), P(0.0)), of_full(full.places(), P(0.0));
  ShelfVector<Complex<P>> of_complex(complex.places(), Complex<P>{P(0.0), P(0.0)});
  const auto put = [&](int i, int k) {
    for (int lane = 0; lane < P::width; ++lane) {
      // Every fourth lane has no diagonal, or none to speak of: the order would lose all digits.
      const double value = i != k          ? std::sin(7.3 * lane + 2.1 * i + 5.7 * k)
                           : lane % 4 == 1 ? 0.0
                           : lane % 4 == 2 ? 1e-12
                                           : 5.0;
      lanes_of<P>::set(of_real[real.place(i, k)], lane, value);
      lanes_of<P>::set(of_full[full.place(i, k)], lane, value);
      lanes_of<P>::set(of_complex[complex.place(i, k)].re, lane, value);
      lanes_of<P>::set(of_complex[complex.place(i, k)].im, lane, i == k ? 1.0 : 0.0);
    }
  };
  for (int i = 0; i < size; ++i) put(i, i);
  for (const auto& [i, k] : pattern) put(i, k);
  real.factorise(entries_of(of_real));
  full.factorise(entries_of(of_full));
  complex.factorise(entries_of(of_complex));
  ShelfVector<P> x(size), same(size);
  ShelfVector<Complex<P>> z(size);
  for (int i = 0; i < size; ++i) x[i] = same[i] = P(right(3, i)), z[i] = {P(right(3, i)), P(0.0)};
  real.solve(x.data());
  full.solve(same.data());
  complex.solve(z.data());
  ShelfVector<P> signs(size);
  real.signs(signs.data());
  for (int lane = 0; lane < P::width; ++lane) {
    CHECK(lanes_of<P>::get(real.weak(), lane) == (lane % 4 == 1 || lane % 4 == 2));
    Eigen::MatrixXcd matrix = Eigen::MatrixXcd::Zero(size, size);
    Eigen::VectorXcd b(size);
    const auto fill = [&](int i, int k) {
      matrix(i, k) = i != k ? std::sin(7.3 * lane + 2.1 * i + 5.7 * k) : lane % 4 == 1 ? 0.0 : lane % 4 == 2 ? 1e-12 : 5.0;
    };
    for (int i = 0; i < size; ++i) fill(i, i), b(i) = right(3, i);
    for (const auto& [i, k] : pattern) fill(i, k);
    const Eigen::VectorXd expected = matrix.real().partialPivLu().solve(b.real());
    if (!(lane % 4 == 1 || lane % 4 == 2)) CHECK(signs[size - 1][lane] * matrix.real().determinant() > 0.0);
    matrix.diagonal().array() += std::complex<double>(0.0, 1.0);
    const Eigen::VectorXcd expected_complex = matrix.partialPivLu().solve(b);
    for (int i = 0; i < size; ++i) {
      CHECK(x[i][lane] == doctest::Approx(expected(i)).epsilon(1e-9));
      CHECK(same[i][lane] == doctest::Approx(expected(i)).epsilon(1e-9));
      CHECK(std::abs(std::complex<double>(z[i].re[lane], z[i].im[lane]) - expected_complex(i)) <
            1e-9 * expected_complex.norm());
    }
  }
}

TEST_CASE("where the first parts of packs alone are in use, they have the same bits") {
  using Wide = Pack<4 * native_lanes>;
  constexpr int size = 24;
  std::vector<std::pair<int, int>> pattern;
  for (int i = 0; i < size; ++i) pattern.emplace_back(i, (i + 1) % size), pattern.emplace_back((i + 5) % size, i);
  EliminationOrder order(size, pattern);
  order.find_targets();
  const auto check = [&]<class T>(T, int parts) {
    LinearSystem<T> all(size, &order), first(size, &order, parts);
    for (auto* system : {&all, &first}) {
      ShelfVector<T> matrix(system->places());
      std::fill_n(reinterpret_cast<double*>(matrix.data()), matrix.size() * sizeof(T) / sizeof(double), 0.0);
      const auto put = [&](int i, int k) {
        double* const numbers = reinterpret_cast<double*>(&matrix[system->place(i, k)]);
        for (std::size_t e = 0; e < sizeof(T) / sizeof(double); ++e)
          numbers[e] = i != k ? std::sin(7.3 * e + 2.1 * i + 5.7 * k) : e % 4 == 1 ? 0.0 : 4.0;  // and rows change places
      };
      for (int i = 0; i < size; ++i) put(i, i);
      for (const auto& [i, k] : pattern) put(i, k);
      system->factorise(entries_of(matrix));
    }
    ShelfVector<T> x(size), same(size);
    for (int i = 0; i < size; ++i) {
      double* const numbers = reinterpret_cast<double*>(&x[i]);
      for (std::size_t e = 0; e < sizeof(T) / sizeof(double); ++e) numbers[e] = right(3, i) + 0.1 * e;
      same[i] = x[i];
    }
    all.solve(x.data());
    first.solve(same.data());
    for (int i = 0; i < size; ++i) {
      const double *a = reinterpret_cast<const double*>(&x[i]), *b = reinterpret_cast<const double*>(&same[i]);
      for (int lane = 0; lane < parts * native_lanes; ++lane)
        for (std::size_t e = lane; e < sizeof(T) / sizeof(double); e += Wide::width) CHECK(a[e] == b[e]);
    }
  };
  for (const int parts : {1, 3}) {
    check(Wide(), parts);
    check(Complex<Wide>(), parts);
  }
}

TEST_CASE("the order of a chain adds no entry, and a full matrix is left alone") {
  std::vector<std::pair<int, int>> chain, full;
  for (int i = 0; i + 1 < 40; ++i) chain.emplace_back(i, i + 1);
  CHECK(EliminationOrder(40, chain).numbers == 40 + 2 * 39);
  for (int i = 0; i < 20; ++i)
    for (int k = 0; k < 20; ++k) full.emplace_back(i, k);
  CHECK_FALSE(EliminationOrder(20, full).pays());
}

TEST_CASE("elimination solves complex systems") {
  Elimination<Complex<double>> system(n);
  ShelfVector<Complex<double>> b(n);
  for (int i = 0; i < n; ++i) {
    b[i] = {right(0, i), right(1, i)};
    for (int k = 0; k < n; ++k) system(i, k) = {entry(1, i, k), entry(3, i, k)};
  }
  system.factorise();
  system.solve(b.data());
  for (int i = 0; i < n; ++i) {
    double re = -right(0, i), im = -right(1, i);
    for (int k = 0; k < n; ++k) {
      re += entry(1, i, k) * b[k].re - entry(3, i, k) * b[k].im;
      im += entry(1, i, k) * b[k].im + entry(3, i, k) * b[k].re;
    }
    CHECK(std::abs(re) + std::abs(im) < 1e-12);
  }
}

TEST_CASE("what is singular gives no finite solution") {
  Elimination<double> system(2);
  system(0, 0) = system(0, 1) = system(1, 0) = system(1, 1) = 1.0;
  ShelfVector<double> b{1.0, 2.0};
  system.factorise();
  system.solve(b.data());
  CHECK_FALSE(std::isfinite(b[0] + b[1]));
}

TEST_CASE("signs of pivots are those of determinants, in lanes whose rows change places and in others") {
  const auto turned = [](int lane, int i, int k) { return lane == 0 && i == 0 ? -entry(lane, i, k) : entry(lane, i, k); };
  Elimination<P> system(n);
  for (int lane = 0; lane < P::width; ++lane)
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) lanes_of<P>::set(system(i, k), lane, turned(lane, i, k));
  system.factorise();
  ShelfVector<P> signs(n);
  system.signs(signs.data());
  int negative = 0;
  for (int lane = 0; lane < P::width; ++lane) {
    Eigen::MatrixXd matrix(n, n);
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) matrix(i, k) = turned(lane, i, k);
    CHECK(signs[n - 1][lane] == (matrix.determinant() < 0 ? -1.0 : 1.0));
    negative += matrix.determinant() < 0;
  }
  CHECK(negative > 0);
  CHECK(negative < P::width);
}

TEST_CASE("eigenvalues on the left of the axis are counted, however far from each other they are") {
  ShelfVector<P> packed(n * n);
  std::array<int, P::width> expected{};
  for (int lane = 0; lane < P::width; ++lane) {
    Eigen::MatrixXd matrix(n, n);
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) matrix(i, k) = entry(lane, i, k) * std::pow(10.0, (lane % 3) * (i - 2));
    for (int j = 0; j < n * n; ++j) lanes_of<P>::set(packed[j], lane, matrix(j / n, j % n));
    for (const auto& value : matrix.eigenvalues()) expected[lane] += value.real() < 0;
  }
  const P counted = eigenvalues_on_left(packed, n);
  for (int lane = 0; lane < P::width; ++lane) CHECK(counted[lane] == doctest::Approx(expected[lane]).epsilon(1e-6));
}

TEST_CASE("two eigenvalues on the left are counted where the determinant is positive") {
  ShelfVector<double> both{-1.0, 0.0, 0.0, -1e8}, rotating{-3.0, 5.0, -5.0, -3.0}, none{1e-6, 1.0, 0.0, 1e8};
  CHECK(eigenvalues_on_left(both, 2) == doctest::Approx(2.0));
  CHECK(eigenvalues_on_left(rotating, 2) == doctest::Approx(2.0));
  CHECK(eigenvalues_on_left(none, 2) == doctest::Approx(0.0));
}

TEST_CASE("a band is eliminated from both its ends, and no entry is added") {
  constexpr int size = 9;
  std::vector<std::pair<int, int>> pattern;
  for (int i = 0; i + 1 < size; ++i) pattern.emplace_back(i, i + 1), pattern.emplace_back(i + 1, i);
  const EliminationOrder order(size, pattern);
  CHECK(order.numbers == 3 * size - 2);
  for (int k = 0; k < size; ++k) CHECK(order.pivots[k].row == (k % 2 ? size - 1 - k / 2 : k / 2));
}

TEST_CASE("implicit steps have an order where it takes far fewer operations, and small models have none") {
  const auto orders_of = [](int states, bool full) {
    std::vector<std::pair<int, int>> entries;
    for (int i = 0; i < states; ++i)
      for (int k = 0; k < states; ++k)
        if (full || std::abs(i - k) < 2) entries.emplace_back(i, k);
    return ImplicitOrders(states, entries);
  };
  const ImplicitOrders band = orders_of(12, false), full = orders_of(12, true), small = orders_of(11, false);
  REQUIRE(band.of_states());
  CHECK(band.of_states()->size() == 12);
  CHECK(band.of_stages()->size() == 36);
  CHECK_FALSE(full.of_states());
  CHECK_FALSE(small.of_states());
  CHECK_FALSE(small.of_stages());
}
