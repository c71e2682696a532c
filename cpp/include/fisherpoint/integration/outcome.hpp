// What the stepping loop tells: the steps that were taken, and how the trajectories of a pack ended.
#pragma once

#include <array>
#include <span>

#include "fisherpoint/integration/status.hpp"
#include "fisherpoint/numbers/lanes.hpp"
#include "fisherpoint/numbers/shelves.hpp"

namespace fisherpoint {

// A step that the lanes of a pack took together; of size 0 in the lanes that took none. A side is 1 or -1, or 0 of a jump that
// the trajectory slides on. Where its distance to a surface grows or falls by far, `growth` is the factor by which it grows, or
// minus that by which it falls; 0 otherwise.
template <class Equation>
struct Step {
  typename Equation::Number size;
  typename Equation::Side side;
  mask_of_lanes<typename Equation::Number> implicit;
  typename Equation::Number growth;
};

template <class Equation>
using Steps = ShelfVector<Step<Equation>>;

// Instants on the way, from the start, increasing and before the end, at which the states of a lane are noted.
struct SamplesOfLane {
  std::span<const double> at;
  double* x = nullptr;  // (count, n_x)
  std::size_t done = 0;
  bool missed = false;  // an implicit step, of which only the end is known
};
template <class P>
struct Samples {
  std::array<SamplesOfLane, lanes_of<P>::width> lanes;
};

template <class P>
struct Outcome {
  std::array<Status, lanes_of<P>::width> status{};
  P first_step{0.0};  // the first step that was taken: a good start for a similar trajectory
  P next_step{0.0};   // what step control would try next: a good start for the trajectory's continuation
  P lasted{0.0};      // until when f could be followed: to the end, or to what ended the trajectory
  int attempts = 0;   // of the slowest lane
  mask_of_lanes<P> stiff = lanes_of<P>::none();  // a continuation begins with implicit steps
  // Where a trajectory starts off a jump without a side from which it comes, or ends next to one, to the tolerance: there may
  // be no derivative.
  mask_of_lanes<P> starts_on_jump = lanes_of<P>::none(), ends_on_jump = lanes_of<P>::none();
};

}  // namespace fisherpoint
