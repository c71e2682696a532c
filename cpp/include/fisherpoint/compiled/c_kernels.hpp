// What a shared object for one model consists of: the kernels behind the functions of c_interface.hpp. Explicit instantiations
// (`template FisherpointSimulate simulate_request<M>;`) say in which file each is compiled.
#pragma once

#include <cstdio>
#include <exception>
#include <new>
#include <stdexcept>

#include "fisherpoint/compiled/c_interface.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/runs.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"

namespace fisherpoint {

struct Request {
  Points points;
  Parameters parameters;
  Tolerance tolerance;
  Workers workers;

  explicit Request(const FisherpointRequest& r)
      : points{static_cast<std::size_t>(r.count), r.x0, r.u, r.dt},
        parameters{r.theta, r.theta_per_point != 0},
        tolerance{.relative = r.rtol,
                  .cross_kinks = r.cross_kinks != 0,
                  .cross_jumps = r.cross_jumps != 0,
                  .method = static_cast<MethodName>(r.method),
                  .whole_first = r.whole_first != 0},
        workers(r.threads, [r] { return r.interrupted(r.asked) != 0; }) {}

  Runs runs(std::int64_t segments, std::int32_t shared) const {
    return {points.count, static_cast<std::size_t>(segments), points.x0, points.u, points.dt, shared != 0};
  }
};

inline FisherpointOutcome outcome_of(const FisherpointRequest& request, auto&& work) {
  const auto failed = [&](const char* reason) {
    std::snprintf(request.reason, fisherpoint_reason_size, "%s", reason);
    return fisherpoint_failed;
  };
  try {
    work();
    return fisherpoint_done;
  } catch (const Interrupted&) {
    return fisherpoint_stopped;
  } catch (const std::bad_alloc&) {
    return fisherpoint_out_of_memory;
  } catch (const std::exception& error) {
    return failed(error.what());
  } catch (...) {
    return failed("an exception of unknown type");
  }
}

// Nodes that the core holds.
class CoreNodes final : public PriorNodes {
 public:
  explicit CoreNodes(const FisherpointNodes& nodes) : nodes_(nodes) {}

  std::size_t size() const override { return static_cast<std::size_t>(nodes_.size); }
  int parameters() const override { return nodes_.parameters; }
  std::vector<double> pilots() const override {
    return {nodes_.pilots, nodes_.pilots + nodes_.pilot_count * nodes_.parameters};
  }
  void read(std::size_t first, std::size_t count, double* theta, double* weight) const override {
    const auto outcome =
        nodes_.read(nodes_.nodes, static_cast<std::int64_t>(first), static_cast<std::int64_t>(count), theta, weight);
    if (outcome == fisherpoint_out_of_memory) throw std::bad_alloc();
    if (outcome != fisherpoint_done) throw std::runtime_error("the nodes of the prior could not be read");
  }

 private:
  const FisherpointNodes& nodes_;
};

inline Status* statuses(std::int32_t* status) { return reinterpret_cast<Status*>(status); }

template <class M>
using CompiledEquation = StateEquation<M, Pack<native_lanes>>;

template <class M>
FisherpointOutcome simulate_request(const FisherpointRequest* request, double* x, double* y, std::int32_t* status,
                                    double* lasted) {
  return outcome_of(*request, [&] {
    const Request r(*request);
    with_method<M>(r.tolerance.method, [&]<class Method>() {
      simulate_packs<Pack<native_lanes>, Method>(M{}, r.points, r.parameters, r.tolerance, r.workers,
                                                 {x, y, statuses(status), lasted});
    });
  });
}

template <class M>
FisherpointOutcome sensitivities_request(const FisherpointRequest* request, double* x, double* y, double* dx_dtheta,
                                         double* dy_dtheta, std::int32_t* status, std::int32_t states_judge) {
  return outcome_of(*request, [&] {
    const Request r(*request);
    with_method<M>(r.tolerance.method, [&]<class Method>() {
      sensitivity_packs<Pack<native_lanes>, Method>(M{}, r.points, r.parameters, r.tolerance, r.workers,
                                                    {x, y, dx_dtheta, dy_dtheta, statuses(status), states_judge != 0});
    });
  });
}

template <class M>
FisherpointOutcome simulate_runs_request(const FisherpointRequest* request, std::int64_t segments, std::int32_t shared,
                                         double* x, std::int32_t* status, std::int64_t* reached) {
  return outcome_of(*request, [&] {
    const Request r(*request);
    with_method<M>(r.tolerance.method, [&]<class Method>() {
      run_packs<Pack<native_lanes>, Method>(M{}, r.runs(segments, shared), r.parameters, r.tolerance, r.workers,
                                            {x, statuses(status), reached});
    });
  });
}

template <class M>
FisherpointOutcome run_sensitivities_request(const FisherpointRequest* request, std::int64_t segments, std::int32_t shared,
                                             const double* s, const unsigned char* measured, std::int64_t moved_each,
                                             const std::int32_t* moved_column, const double* moved_u, std::int32_t doubts,
                                             double* x, double* y, double* dx_dtheta, double* dy_dtheta, std::int32_t* status,
                                             std::int64_t* reached) {
  return outcome_of(*request, [&] {
    const Request r(*request);
    const RunStart start{s, measured, {static_cast<std::size_t>(moved_each), moved_column, moved_u}, doubts != 0};
    with_method<M>(r.tolerance.method, [&]<class Method>() {
      run_sensitivity_packs<Pack<native_lanes>, Method>(M{}, r.runs(segments, shared), start, r.parameters, r.tolerance,
                                                        r.workers, {x, y, dx_dtheta, dy_dtheta, statuses(status), reached});
    });
  });
}

template <class M>
FisherpointOutcome predictive_covariance_request(const FisherpointRequest* request, const FisherpointNodes* nodes,
                                                 double max_lost, double* covariance, std::int32_t* status,
                                                 std::int64_t* redone, double* lost, double* y) {
  return outcome_of(*request, [&] {
    const Request r(*request);
    with_method<M>(r.tolerance.method, [&]<class Method>() {
      predictive_covariance_packs<Pack<native_lanes>, Method>(M{}, r.points, request->theta, CoreNodes(*nodes), max_lost,
                                                              r.tolerance, r.workers,
                                                              {covariance, statuses(status), redone, lost, y});
    });
  });
}

template <class M>
inline constexpr FisherpointKernels kernels_of{fisherpoint_interface_version, simulate_request<M>,
                                               sensitivities_request<M>,      simulate_runs_request<M>,
                                               run_sensitivities_request<M>,  predictive_covariance_request<M>};

}  // namespace fisherpoint
