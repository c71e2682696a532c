#include "fisherpoint/chain.hpp"

#include "fisherpoint/kernel_models.hpp"

namespace fisherpoint {

template <class M>
void chain(const M& model, const Points& records, std::size_t pieces, const Parameters& parameters, const Tolerance& tolerance,
           const Workers& workers, const ChainedStates& out) {
  with_method(tolerance.method, [&]<class Method>(Method) {
    chain_packs<Pack<lanes_for<M>>, Method>(model, records, pieces, parameters, tolerance, workers, out);
  });
}

template void chain(const FISHERPOINT_MODEL&, const Points&, std::size_t, const Parameters&, const Tolerance&, const Workers&,
                    const ChainedStates&);

}  // namespace fisherpoint
