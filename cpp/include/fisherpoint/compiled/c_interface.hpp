// The kernels of one model as plain C functions of a shared object that is built while the program runs (c_kernels.hpp): no
// type but PriorNodes crosses its border, and no exception.
#pragma once

#include <cstdint>

#include "fisherpoint/prior/prior_nodes.hpp"

extern "C" {

enum { fisherpoint_reason_size = 200 };

// What every kernel is asked. Arrays are as in points.hpp.
struct FisherpointRequest {
  std::int64_t count;
  const double *x0, *u, *dt, *theta;
  std::int32_t theta_per_point, cross_kinks, method, whole_first, threads;  // method: 0 the fastest, 1 RK45, 2 DOP853
  double rtol;
  int (*interrupted)(const void* asked);  // on the calling thread, now and then; not 0 ends the work
  const void* asked;
  char* reason;  // of a failure, for the kernel to write: room for fisherpoint_reason_size characters
};

enum FisherpointOutcome : std::int32_t { fisherpoint_done, fisherpoint_stopped, fisherpoint_out_of_memory, fisherpoint_failed };

}  // extern "C"

namespace fisherpoint {

using SimulateFunction = FisherpointOutcome(const FisherpointRequest*, double* x, double* y, std::int32_t* status);
using SensitivitiesFunction = FisherpointOutcome(const FisherpointRequest*, double* x, double* y, double* dx_dtheta,
                                                 double* dy_dtheta, std::int32_t* status);
// x0 is of `count` records; u and dt are of `pieces`.
using RecordsFunction = FisherpointOutcome(const FisherpointRequest*, std::int64_t pieces, double* x, std::int32_t* status,
                                           std::int64_t* reached);
using PredictiveCovarianceFunction = FisherpointOutcome(const FisherpointRequest*, const PriorNodes* nodes, double max_lost,
                                                        double* covariance, std::int32_t* status, std::int64_t* redone,
                                                        double* lost, double* y);

}  // namespace fisherpoint
