// States of bodies: where they will be, and which bodies of other worlds come near. A state (13,) has the columns position
// [m], orientation (x, y, z, w), velocity [m/s] and angular velocity [rad/s].
#pragma once

#include <cstddef>

#include "solid.h"

namespace smartmesh {

// Takes a position (3,) [m] that was `found` after a step: `moved` is the way from the one before.
void take_position(const double* found, double* position, double* moved);

// Takes a state that was `found`: `moved` [m] is the motion in a step of `dt` [s].
void take_state(const double* found, double dt, double* state, double* position, double* moved);

// Writes a state extrapolated by a `duration` [s], which may be negative, at constant velocities.
void extrapolate(const double* state, double duration, double* moved);

// Writes the state that is a `share` (0 to 1) of the way from one to a `target`.
void blend(const double* state, const double* target, double share, double* drawn);

// Remote bodies: `states` (count, 13), bounding `radii` (count,) [m], and `margins` (count,) [m] within which they are
// near.
struct RemoteBodies {
  const double *states, *radii, *margins;
  std::size_t count;
};

// Attached bodies of this world: `positions` (count, 3) [m], NaN = unknown, `velocities` (count, 3) [m/s], bounding
// `radii` (count,) [m], and which of them are its `own`.
struct OwnBodies {
  const double *positions, *velocities, *radii;
  const bool* own;
  std::size_t count;
};

// Writes which remote bodies, extrapolated by a `duration` [s], are near (count,): with the bounding sphere within the
// margin of that of any own body, or able to come there within a `horizon` [s] at their relative speed.
void find_near(const RemoteBodies& remote, double duration, const OwnBodies& bodies, double horizon, bool* near);

// Bodies of this world: `positions` (count, 3) [m] before the last step, by how much they `moved` in it (count, 3) [m],
// bounding `radii` (count,) [m], which of them are `guests`, and which are `solid`.
struct SteppedBodies {
  const double *positions, *moved, *radii;
  const bool *guests, *solid;
  std::size_t count;
};

// Writes which guests came within a `slack` [m] of the bounding sphere of another solid body in the last step (count,).
void find_touching(const SteppedBodies& bodies, double slack, bool* found);

}  // namespace smartmesh
