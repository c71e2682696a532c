#include "fisherpoint/kernels/sensitivities.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"

namespace fisherpoint {

template <class M>
void sensitivities(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const SensitiveTrajectories& out) {
  with_method<M>(tolerance.method, [&]<class Method>() {
    sensitivity_packs<Pack<lanes_for<M>>, Method>(model, points, parameters, tolerance, workers, out);
  });
}

template void sensitivities(const FISHERPOINT_MODEL&, const Points&, const Parameters&, const Tolerance&, const Workers&,
                            const SensitiveTrajectories&);

template <class M>
void run_sensitivities(const M& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                       const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out) {
  with_method<M>(tolerance.method, [&]<class Method>() {
    run_sensitivity_packs<Pack<lanes_for<M>>, Method>(model, runs, start, parameters, tolerance, workers, out);
  });
}

template void run_sensitivities(const FISHERPOINT_MODEL&, const Runs&, const RunStart&, const Parameters&, const Tolerance&,
                                const Workers&, const SensitiveRuns&);

}  // namespace fisherpoint
