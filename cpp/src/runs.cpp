#include "fisherpoint/kernels/runs.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void simulate_runs(const M& model, const Runs& runs, const Parameters& parameters, const Tolerance& tolerance,
                   const Workers& workers, const RunStates& out) {
  with_method<M>(tolerance.method, [&]<class Method>() {
    run_packs<Pack<lanes_for<M>>, Method>(model, runs, parameters, tolerance, workers, out);
  });
}

template void simulate_runs(const FISHERPOINT_MODEL&, const Runs&, const Parameters&, const Tolerance&, const Workers&,
                            const RunStates&);

}  // namespace fisherpoint
