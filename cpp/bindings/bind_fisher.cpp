#include <memory>
#include <mutex>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/kernels/fisher_accumulator.hpp"

namespace fisherpoint::bindings {
namespace {

Matrix to_matrix(const Input& array, py::ssize_t rows, const char* name) {
  check_shape(array, {rows, rows}, name);
  return MatrixView(array.data(), rows, rows);
}

py::array_t<double> to_array(const Matrix& matrix) {
  auto result = empty({matrix.rows(), matrix.cols()});
  std::copy_n(matrix.data(), matrix.size(), result.mutable_data());
  return result;
}

// Works without the interpreter lock; one thread at a time, as the lock held it.
class Accumulator : public FisherAccumulator {
 public:
  using FisherAccumulator::FisherAccumulator;

  auto unlocked(auto&& work) const {
    const py::gil_scoped_release released;
    const std::lock_guard alone(working_);
    return work();
  }

 private:
  mutable std::mutex working_;
};

void check_points(const FisherAccumulator& f, const Input& s, const Input& c) {
  check_shape(s, {-1, f.outputs(), f.parameters()}, "dy_dtheta");
  check_shape(c, {s.shape(0), f.outputs(), f.outputs()}, "predictive_covariance");
}

// Adds or removes point after point.
auto each(void (FisherAccumulator::*change)(const double*, const double*)) {
  return [change](Accumulator& f, const Input& s, const Input& c) {
    check_points(f, s, c);
    f.unlocked([&] {
      for (py::ssize_t k = 0; k < s.shape(0); ++k) (f.*change)(s.data(k, 0, 0), c.data(k, 0, 0));
    });
  };
}

auto log_det_changed(int sign) {
  return [sign](const Accumulator& f, const Input& s, const Input& c, const Input& given, bool pooled, double ridge,
                int nuisance) {
    check_points(f, s, c);
    if (nuisance < 0 || nuisance >= f.parameters()) throw py::value_error("nuisance: expected fewer than the parameters");
    auto result = empty({s.shape(0)});
    const auto count = static_cast<std::size_t>(s.shape(0));
    const OutputCovariance d{to_matrix(given, f.outputs(), "given"), pooled};
    double* const out = result.mutable_data();
    f.unlocked([&] { f.log_det_changed(sign, count, s.data(), c.data(), d, ridge, nuisance, out); });
    return result;
  };
}

}  // namespace

void bind_fisher(py::module_& m) {
  using namespace py::literals;
  m.def(
      "log_det",
      [](const Input& given) {
        const Matrix a = to_matrix(given, given.ndim() == 2 ? given.shape(0) : -1, "matrix");
        const py::gil_scoped_release released;
        return log_det(a);
      },
      "matrix"_a, "log det by Cholesky; -inf where the matrix is not positive definite.");

  py::class_<Accumulator>(m, "FisherAccumulator", "Fisher matrix (7) of a set of points, for any output covariance.")
      .def(py::init([](int outputs, int parameters) {
             if (outputs < 1 || parameters < 1) throw py::value_error("FisherAccumulator: expected positive sizes");
             return std::make_unique<Accumulator>(outputs, parameters);
           }),
           "outputs"_a, "parameters"_a)
      .def("__len__", [](const Accumulator& f) { return f.unlocked([&] { return f.count(); }); })
      .def("add", each(&FisherAccumulator::add), "dy_dtheta"_a, "predictive_covariance"_a,
           "Add points: (K, n_y, p) and (K, n_y, n_y).")
      .def("remove", each(&FisherAccumulator::remove), "dy_dtheta"_a, "predictive_covariance"_a,
           "Remove points that were added.")
      .def(
          "output_covariance",
          [](const Accumulator& f, const Input& given, bool pooled) {
            const OutputCovariance d{to_matrix(given, f.outputs(), "given"), pooled};
            return to_array(f.unlocked([&] { return f.output_covariance(d); }));
          },
          "given"_a, "pooled"_a, "D = given, plus the mean predictive covariance (17) where pooled.")
      .def(
          "fisher",
          [](const Accumulator& f, const Input& given) {
            const Matrix d = to_matrix(given, f.outputs(), "output_covariance");
            return to_array(f.unlocked([&] { return f.fisher(d); }));
          },
          "output_covariance"_a, "F (p, p) by (7).")
      .def(
          "log_det_with", log_det_changed(+1), "dy_dtheta"_a, "predictive_covariance"_a, "given"_a, "pooled"_a, "ridge"_a = 0.0,
          "nuisance"_a = 0,
          "log det F with each of the points added alone; the last `nuisance` parameters, with unit information, marginalised.")
      .def("log_det_without", log_det_changed(-1), "dy_dtheta"_a, "predictive_covariance"_a, "given"_a, "pooled"_a,
           "ridge"_a = 0.0, "nuisance"_a = 0, "The same with each of the points removed alone.");
}

}  // namespace fisherpoint::bindings
