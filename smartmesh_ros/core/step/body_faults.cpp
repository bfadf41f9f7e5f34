#include "step/body_faults.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Returns true if none of some numbers is beyond a limit, or NaN.
bool all_within(const double* numbers, std::size_t count, double limit) {
  return std::all_of(numbers, numbers + count, [&](double value) { return std::abs(value) <= limit; });
}

bool is_between(double value, double least, double largest) { return value >= least && value <= largest; }

Fault fault_of_state(const double* state, const BodyLimits& limits) {
  if (!std::all_of(state, state + 13, [](double value) { return std::isfinite(value); })) return Fault::NotFinite;
  const double length =
      std::sqrt(state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6]);
  if (!(std::abs(length - 1.0) <= limits.slack)) return Fault::Orientation;
  if (!all_within(state, 3, limits.farthest)) return Fault::Position;
  if (!all_within(state + 7, 3, limits.fastest)) return Fault::Velocity;
  return all_within(state + 10, 3, limits.fastest_spin) ? Fault::None : Fault::Spin;
}

}  // namespace

Fault fault_of(const DescribedBodies& bodies, std::size_t body, const BodyLimits& limits) {
  const Fault fault = fault_of_state(bodies.states + 13 * body, limits);
  const std::size_t kind = bodies.kinds[body];
  if (fault != Fault::None) return fault;
  if (kind >= limits.dimensions.size() || limits.dimensions[kind] == 0) return Fault::Kind;
  for (int k = 0; k < std::min<std::int64_t>(limits.dimensions[kind], 3); ++k)
    if (!is_between(bodies.dimensions[3 * body + k], limits.least_size, limits.largest_size)) return Fault::Size;
  if (!all_within(bodies.centres + 3 * body, 3, limits.largest_size)) return Fault::Centre;
  if (!is_between(bodies.radii[body], limits.least_size, limits.largest_size)) return Fault::Radius;
  return is_between(bodies.masses[body], limits.least_mass, limits.largest_mass) ? Fault::None : Fault::Mass;
}

}  // namespace smartmesh
