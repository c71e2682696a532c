// What passes between the core and a shared object with the kernels of one model, which is built while the program runs: types
// of C alone, and no exception. A change here is a new version.
#pragma once

#include <cstdint>

extern "C" {

enum : std::int32_t { fisherpoint_interface_version = 6 };
enum { fisherpoint_reason_size = 200 };
enum FisherpointOutcome : std::int32_t { fisherpoint_done, fisherpoint_stopped, fisherpoint_out_of_memory, fisherpoint_failed };

// What every kernel is asked. Arrays are as in points.hpp.
struct FisherpointRequest {
  std::int64_t count;
  const double *x0, *u, *dt, *theta;
  std::int32_t theta_per_point, cross_kinks, cross_jumps, method, whole_first,
      threads;  // method: 0 the fastest, 1 RK45, 2 DOP853
  double rtol;
  std::int32_t (*interrupted)(const void* asked);  // on the calling thread, now and then; not 0 ends the work
  const void* asked;
  char* reason;  // of a failure, for the kernel to write: room for fisherpoint_reason_size characters
};

struct FisherpointNodes {
  std::int64_t size;
  std::int32_t parameters, pilot_count;
  const double* pilots;  // (pilot_count, parameters)
  // Writes theta (parameters, count) and weight (count,) of the nodes from `first` on; asked on any thread.
  FisherpointOutcome (*read)(const void* nodes, std::int64_t first, std::int64_t count, double* theta, double* weight);
  const void* nodes;
};

using FisherpointSimulate = FisherpointOutcome(const FisherpointRequest*, double* x, double* y, std::int32_t* status,
                                               double* lasted);
// dx_dtheta may be null: then dy_dtheta alone is asked for, and `states_judge` says whether ends on jumps are judged by both.
using FisherpointSensitivities = FisherpointOutcome(const FisherpointRequest*, double* x, double* y, double* dx_dtheta,
                                                    double* dy_dtheta, std::int32_t* status, std::int32_t states_judge);
// x0 is of `count` runs; u and dt are of their segments, or of those that all share.
using FisherpointSimulateRuns = FisherpointOutcome(const FisherpointRequest*, std::int64_t segments, std::int32_t shared,
                                                   double* x, std::int32_t* status, std::int64_t* reached);
// s, dx_dtheta and what is moved may be null; `moved_each` columns and inputs of every segment (moved_switches.hpp).
using FisherpointRunSensitivities = FisherpointOutcome(const FisherpointRequest*, std::int64_t segments, std::int32_t shared,
                                                       const double* s, const unsigned char* measured, std::int64_t moved_each,
                                                       const std::int32_t* moved_column, const double* moved_u,
                                                       std::int32_t doubts, double* x, double* y, double* dx_dtheta,
                                                       double* dy_dtheta, std::int32_t* status, std::int64_t* reached);
using FisherpointPredictiveCovariance = FisherpointOutcome(const FisherpointRequest*, const FisherpointNodes*, double max_lost,
                                                           double* covariance, std::int32_t* status, std::int64_t* redone,
                                                           double* lost, double* y);

struct FisherpointKernels {
  std::int32_t version;  // the first of every version
  FisherpointSimulate* simulate;
  FisherpointSensitivities* sensitivities;
  FisherpointSimulateRuns* simulate_runs;
  FisherpointRunSensitivities* run_sensitivities;
  FisherpointPredictiveCovariance* predictive_covariance;
};

// The shared object's only function, `fisherpoint_kernels`.
using FisherpointLibrary = const FisherpointKernels*();

}  // extern "C"
