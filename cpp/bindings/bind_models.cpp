#include <pybind11/stl.h>

#include <array>
#include <string>
#include <tuple>

#include "arrays.hpp"
#include "bindings.hpp"
#include "fisherpoint/models/hydraulic_cylinder.hpp"

namespace fisherpoint::bindings {
namespace {

py::list quantities(const auto& all) {
  py::list result;
  for (const Quantity& q : all)
    result.append(py::make_tuple(std::string(q.name), std::string(q.unit), std::string(q.description), q.scale));
  return result;
}

py::list names(const auto& surfaces) {
  py::list result;
  for (const Surface& surface : surfaces) result.append(std::string(surface.name));
  return result;
}

template <class T, std::size_t n>
std::array<T, n> row(const T* from) {
  std::array<T, n> values;
  std::copy_n(from, n, values.begin());
  return values;
}

// Applies function(x, u, theta) to every row and stacks the results.
template <Model M, std::size_t width>
py::array_t<double> map_rows(const Input& x, const Input& u, const Input& theta, const auto& function) {
  const py::ssize_t count = x.ndim() == 2 ? x.shape(0) : -1;
  check_shape(x, {count, sizes<M>::states}, "x");
  check_shape(u, {count, sizes<M>::inputs}, "u");
  check_shape(theta, {count, sizes<M>::parameters}, "theta");
  auto result = empty({count, static_cast<py::ssize_t>(width)});
  const py::gil_scoped_release unlocked;
  for (py::ssize_t k = 0; k < count; ++k) {
    const auto values =
        to_array<double>(function(row<double, sizes<M>::states>(x.data(k, 0)), row<double, sizes<M>::inputs>(u.data(k, 0)),
                                  row<double, sizes<M>::parameters>(theta.data(k, 0))));
    std::copy(values.begin(), values.end(), result.mutable_data(k, 0));
  }
  return result;
}

template <Model M>
py::class_<M> bind_model(py::module_& m, const char* class_name) {
  using namespace py::literals;
  py::class_<M> bound(m, class_name);
  bound.attr("name") = std::string(M::name);
  bound.attr("states") = quantities(M::states);
  bound.attr("inputs") = quantities(M::inputs);
  bound.attr("outputs") = quantities(M::outputs);
  bound.attr("parameters") = quantities(M::parameters);
  bound.attr("jumps") = names(M::jumps);
  bound.attr("kinks") = names(M::kinks);
  bound.attr("domain") = names(M::domain);
  bound
      .def(
          "rhs",
          [](const M& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows<M, sizes<M>::states>(x, u, theta, [&](const auto& x, const auto& u, const auto& theta) {
              auto side = to_array<double>(model.switching(x, u, theta));
              for (double& s : side) s = s > 0 ? 1.0 : s < 0 ? -1.0 : 0.0;
              return model.dynamics(theta)(x, u, side);
            });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "output",
          [](const M& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows<M, sizes<M>::outputs>(x, u, theta, [&](const auto&... a) { return model.output(a...); });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "switching",
          [](const M& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows<M, sizes<M>::switching>(x, u, theta, [&](const auto&... a) { return model.switching(a...); });
          },
          "x"_a, "u"_a, "theta"_a)
      .def(
          "limits",
          [](const M& model, const Input& x, const Input& u, const Input& theta) {
            return map_rows<M, sizes<M>::limits>(x, u, theta, [&](const auto&... a) { return model.limits(a...); });
          },
          "x"_a, "u"_a, "theta"_a);
  return bound;
}

}  // namespace

void bind_models(py::module_& m) {
  using C = HydraulicCylinder;
  bind_model<C>(m, "HydraulicCylinder")
      .def(py::init([](double A_A, double A_B, double q_min, double q_max, double p_s, double T_1, double k_u) {
             return C{A_A, A_B, q_min, q_max, p_s, T_1, k_u};
           }),
           py::kw_only(), py::arg("A_A") = C{}.A_A, py::arg("A_B") = C{}.A_B, py::arg("q_min") = C{}.q_min,
           py::arg("q_max") = C{}.q_max, py::arg("p_s") = C{}.p_s, py::arg("T_1") = C{}.T_1, py::arg("k_u") = C{}.k_u)
      .def_readonly("A_A", &C::A_A)
      .def_readonly("A_B", &C::A_B)
      .def_readonly("q_min", &C::q_min)
      .def_readonly("q_max", &C::q_max)
      .def_readonly("p_s", &C::p_s)
      .def_readonly("T_1", &C::T_1)
      .def_readonly("k_u", &C::k_u);
}

}  // namespace fisherpoint::bindings
