#include "fisherpoint/kernels/records.hpp"

#include "fisherpoint/kernels/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void simulate_records(const M& model, const Points& records, std::size_t pieces, const Parameters& parameters,
                      const Tolerance& tolerance, const Workers& workers, const RecordStates& out) {
  with_method(tolerance.method, [&]<class Method>(Method) {
    record_packs<Pack<lanes_for<M>>, Method>(model, records, pieces, parameters, tolerance, workers, out);
  });
}

template void simulate_records(const FISHERPOINT_MODEL&, const Points&, std::size_t, const Parameters&, const Tolerance&,
                               const Workers&, const RecordStates&);

}  // namespace fisherpoint
