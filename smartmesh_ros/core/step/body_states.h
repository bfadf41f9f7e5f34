// States of bodies: where they will be, and which bodies of other worlds come near.
#pragma once

#include <cstddef>

#include "shape/solid.h"

namespace smartmesh {

// Returns a state extrapolated by a `duration` [s], which may be negative, at constant velocities.
BodyState extrapolated(const BodyState& state, double duration);

// Returns the state that is a `share` (0 to 1) of the way from one to a `target`.
BodyState blended(const BodyState& state, const BodyState& target, double share);

// Remote bodies: `states`, bounding `radii` [m], and `margins` [m] within which they are near.
struct RemoteBodies {
  const BodyState* states;
  const double *radii, *margins;
  std::size_t count;
};

// Attached bodies of this world: `positions` [m], NaN = unknown, `velocities` [m/s], bounding `radii` [m], and which of
// them are its `own`.
struct OwnBodies {
  const Vec3 *positions, *velocities;
  const double* radii;
  const bool* own;
  std::size_t count;
};

// Writes which remote bodies, extrapolated by a `duration` [s], are near (count,): with the bounding sphere within the
// margin of that of any own body, or able to come there within a `horizon` [s] at their relative speed.
void find_near(const RemoteBodies& remote, double duration, const OwnBodies& bodies, double horizon, bool* near);

// Bodies of this world: `positions` [m] before the last step, by how much they `moved` in it [m], bounding `radii` [m],
// which of them are `guests`, and which are `solid`.
struct SteppedBodies {
  const Vec3 *positions, *moved;
  const double* radii;
  const bool *guests, *solid;
  std::size_t count;
};

// Writes which guests came within a `slack` [m] of the bounding sphere of another solid body in the last step (count,).
void find_touching(const SteppedBodies& bodies, double slack, bool* found);

}  // namespace smartmesh
