// The kernels of one model behind plain C functions, for a shared object that is built while the program runs: no type but
// PriorNodes crosses its border, and no exception.
#pragma once

#include <cstdint>
#include <exception>

#include "predictive_covariance.hpp"
#include "sensitivities.hpp"
#include "simulate.hpp"

extern "C" {

// What every kernel is asked. Arrays are as in points.hpp.
struct FisherpointRequest {
  std::int64_t count;
  const double *x0, *u, *dt, *theta;
  std::int32_t theta_per_point, cross_kinks, method, threads;  // method: 0 the fastest, 1 RK45, 2 DOP853
  double rtol;
  const volatile std::int32_t* stop;  // set from another thread to end the work
};

enum FisherpointOutcome : std::int32_t { fisherpoint_done, fisherpoint_stopped, fisherpoint_failed };

}  // extern "C"

namespace fisherpoint {

struct Request {
  Points points;
  Parameters parameters;
  Tolerance tolerance;
  Workers workers;

  explicit Request(const FisherpointRequest& r)
      : points{static_cast<std::size_t>(r.count), r.x0, r.u, r.dt},
        parameters{r.theta, r.theta_per_point != 0},
        tolerance{.relative = r.rtol, .cross_kinks = r.cross_kinks != 0, .method = static_cast<MethodName>(r.method)},
        workers(r.threads, [stop = r.stop] { return *stop != 0; }) {}
};

inline FisherpointOutcome outcome_of(auto&& work) {
  try {
    work();
    return fisherpoint_done;
  } catch (const Interrupted&) {
    return fisherpoint_stopped;
  } catch (const std::exception&) {
    return fisherpoint_failed;
  }
}

template <class M>
FisherpointOutcome simulate_request(const FisherpointRequest& request, double* x, double* y, std::int32_t* status) {
  return outcome_of([&] {
    const Request r(request);
    with_method(r.tolerance.method, [&]<class Method>(Method) {
      simulate_packs<Pack<native_lanes>, Method>(M{}, r.points, r.parameters, r.tolerance, r.workers,
                                                 {x, y, reinterpret_cast<Status*>(status)});
    });
  });
}

template <class M>
FisherpointOutcome sensitivities_request(const FisherpointRequest& request, double* x, double* y, double* dx_dtheta,
                                         double* dy_dtheta, std::int32_t* status) {
  return outcome_of([&] {
    const Request r(request);
    with_method(r.tolerance.method, [&]<class Method>(Method) {
      sensitivity_packs<Pack<native_lanes>, Method>(M{}, r.points, r.parameters, r.tolerance, r.workers,
                                                    {x, y, dx_dtheta, dy_dtheta, reinterpret_cast<Status*>(status)});
    });
  });
}

template <class M>
FisherpointOutcome predictive_covariance_request(const FisherpointRequest& request, const PriorNodes* nodes, double max_lost,
                                                 double* covariance, std::int32_t* status, std::int64_t* redone, double* lost,
                                                 double* y) {
  return outcome_of([&] {
    const Request r(request);
    with_method(r.tolerance.method, [&]<class Method>(Method) {
      predictive_covariance_packs<Pack<native_lanes>, Method>(M{}, r.points, request.theta, *nodes, max_lost, r.tolerance, r.workers,
                                                              {covariance, reinterpret_cast<Status*>(status), redone, lost, y});
    });
  });
}

}  // namespace fisherpoint
