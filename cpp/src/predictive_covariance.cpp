#include "fisherpoint/kernels/predictive_covariance.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void predictive_covariance(const M& model, const Points& points, const double* nominal_theta, const PriorNodes& nodes,
                           double max_lost, const Tolerance& tolerance, const Workers& workers,
                           const PredictiveCovariances& out) {
  with_method<M>(tolerance.method, [&]<class Method>() {
    predictive_covariance_packs<Pack<lanes_for<M>>, Method>(model, points, nominal_theta, nodes, max_lost, tolerance, workers,
                                                            out);
  });
}

template void predictive_covariance(const FISHERPOINT_MODEL&, const Points&, const double*, const PriorNodes&, double,
                                    const Tolerance&, const Workers&, const PredictiveCovariances&);

}  // namespace fisherpoint
