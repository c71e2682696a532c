#include "fisherpoint/kernels/sensitivities.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out) {
  with_method(tolerance.method, [&]<class Method>(Method) {
    sensitivity_packs<Pack<lanes_for<M>>, Method>(model, points, parameters, tolerance, workers, out);
  });
}

template void sensitivities(const FISHERPOINT_MODEL&, const Points&, const Parameters&, const Tolerance&, const Workers&,
                            const SensitiveTrajectories&);

}  // namespace fisherpoint
