// A tape with kernels that were compiled for it while the program runs: the same model, faster.
#pragma once

#include <new>
#include <stdexcept>
#include <string>

#include "fisherpoint/compiled/c_interface.hpp"
#include "fisherpoint/compiled/library.hpp"
#include "fisherpoint/kernels/predictive_covariance.hpp"
#include "fisherpoint/kernels/run_sensitivities.hpp"
#include "fisherpoint/kernels/runs.hpp"
#include "fisherpoint/kernels/sensitivities.hpp"
#include "fisherpoint/kernels/simulate.hpp"
#include "fisherpoint/models/tape.hpp"

namespace fisherpoint {

class CompiledModel : public TapeModel {
 public:
  // Throws std::runtime_error where the shared object is none for a model. It stays loaded.
  CompiledModel(const TapeModel& tape, const std::string& path)
      : TapeModel(tape), kernels_(table_of<FisherpointLibrary>(path, "fisherpoint_kernels", fisherpoint_interface_version)) {}

  const FisherpointKernels& kernels() const { return *kernels_; }

 private:
  const FisherpointKernels* kernels_;
};

inline const Shape<TapeModel>& shape_of(const CompiledModel& model) { return model.shape(); }

namespace detail {

// Calls a kernel; throws what it could not.
template <class Kernel, class... Rest>
void ask(Kernel* kernel, const Points& points, const double* theta, bool per_point, const Tolerance& tolerance,
         const Workers& workers, Rest... rest) {
  char reason[fisherpoint_reason_size] = "";
  const FisherpointRequest request{
      static_cast<std::int64_t>(points.count),
      points.x0,
      points.u,
      points.dt,
      theta,
      per_point,
      tolerance.cross_kinks,
      tolerance.cross_jumps,
      static_cast<std::int32_t>(tolerance.method),
      tolerance.whole_first,
      workers.threads(),
      tolerance.relative,
      [](const void* asked) -> std::int32_t { return static_cast<const Workers*>(asked)->interrupted(); },
      &workers,
      reason};
  switch (kernel(&request, rest...)) {
    case fisherpoint_done:
      return;
    case fisherpoint_stopped:
      throw Interrupted{};
    case fisherpoint_out_of_memory:
      throw std::bad_alloc();
    default:
      throw std::runtime_error(std::string("compiled model: expected its kernel to end, given: ") + reason);
  }
}

inline std::int32_t* plain(Status* status) { return reinterpret_cast<std::int32_t*>(status); }

}  // namespace detail

inline void simulate(const CompiledModel& model, const Points& points, const Parameters& parameters, const Tolerance& tolerance,
                     const Workers& workers, const Trajectories& out) {
  detail::ask(model.kernels().simulate, points, parameters.theta, parameters.per_point, tolerance, workers, out.x, out.y,
              detail::plain(out.status), out.lasted);
}

inline void sensitivities(const CompiledModel& model, const Points& points, const Parameters& parameters,
                          const Tolerance& tolerance, const Workers& workers, const SensitiveTrajectories& out) {
  detail::ask(model.kernels().sensitivities, points, parameters.theta, parameters.per_point, tolerance, workers, out.x, out.y,
              out.dx_dtheta, out.dy_dtheta, detail::plain(out.status), std::int32_t{out.states_judge});
}

inline void simulate_runs(const CompiledModel& model, const Runs& runs, const Parameters& parameters,
                          const Tolerance& tolerance, const Workers& workers, const RunStates& out) {
  detail::ask(model.kernels().simulate_runs, Points{runs.count, runs.x0, runs.u, runs.dt}, parameters.theta,
              parameters.per_point, tolerance, workers, static_cast<std::int64_t>(runs.segments),
              static_cast<std::int32_t>(runs.shared), out.x, detail::plain(out.status), out.reached);
}

inline void run_sensitivities(const CompiledModel& model, const Runs& runs, const RunStart& start, const Parameters& parameters,
                              const Tolerance& tolerance, const Workers& workers, const SensitiveRuns& out) {
  detail::ask(model.kernels().run_sensitivities, Points{runs.count, runs.x0, runs.u, runs.dt}, parameters.theta,
              parameters.per_point, tolerance, workers, static_cast<std::int64_t>(runs.segments),
              static_cast<std::int32_t>(runs.shared), start.s, start.measured, static_cast<std::int64_t>(start.moved.each),
              start.moved.column, start.moved.u, static_cast<std::int32_t>(start.doubts), out.x, out.y, out.dx_dtheta,
              out.dy_dtheta, detail::plain(out.status), out.reached);
}

inline void predictive_covariance(const CompiledModel& model, const Points& points, const double* nominal_theta,
                                  const PriorNodes& nodes, double max_lost, const Tolerance& tolerance, const Workers& workers,
                                  const PredictiveCovariances& out) {
  const std::vector<double> pilots = nodes.pilots();
  const auto read = [](const void* of, std::int64_t first, std::int64_t count, double* theta, double* weight) {
    try {
      static_cast<const PriorNodes*>(of)->read(static_cast<std::size_t>(first), static_cast<std::size_t>(count), theta, weight);
      return fisherpoint_done;
    } catch (const std::bad_alloc&) {
      return fisherpoint_out_of_memory;
    } catch (...) {
      return fisherpoint_failed;
    }
  };
  const FisherpointNodes plain{static_cast<std::int64_t>(nodes.size()),
                               nodes.parameters(),
                               static_cast<std::int32_t>(pilots.size() / std::max(nodes.parameters(), 1)),
                               pilots.data(),
                               read,
                               &nodes};
  detail::ask(model.kernels().predictive_covariance, points, nominal_theta, false, tolerance, workers, &plain, max_lost,
              out.covariance, detail::plain(out.status), out.redone, out.lost, out.y);
}

}  // namespace fisherpoint
