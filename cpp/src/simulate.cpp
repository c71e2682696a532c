#include "fisherpoint/kernels/simulate.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void simulate(const M& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
              const Workers& workers, const Trajectories& out) {
  with_method<M>(tolerance.method, [&]<class Method>() {
    simulate_packs<Pack<lanes_for<M>>, Method>(model, points, parameters, tolerance, workers, out);
  });
}

template void simulate(const FISHERPOINT_MODEL&, const Points&, const Parameters&, const Tolerance&, const Workers&,
                       const Trajectories&);

}  // namespace fisherpoint
