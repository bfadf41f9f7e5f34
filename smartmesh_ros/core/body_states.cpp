#include "body_states.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Horizontal bounds, largest speed and largest radius of the own bodies whose positions are known.
struct Extent {
  Bounds bounds;
  double fastest = 0.0, largest = 0.0;
};

Extent extent_of(const OwnBodies& bodies) {
  Extent extent;
  for (std::size_t j = 0; j < bodies.count; ++j) {
    if (!bodies.own[j] || std::isnan(bodies.positions[3 * j])) continue;
    extent.bounds.add(vector_at(bodies.positions + 3 * j));
    extent.fastest = std::max(extent.fastest, norm(vector_at(bodies.velocities + 3 * j)));
    extent.largest = std::max(extent.largest, bodies.radii[j]);
  }
  return extent;
}

// Returns true if a body at `p` comes near an own body: its sphere grown by the margin has the radius `reach` [m]. Bodies
// that are farther away than `most` [m] do not.
bool is_near_any(const Vec3& p, const Vec3& velocity, double reach, double most, const OwnBodies& bodies,
                 double horizon) {
  for (std::size_t j = 0; j < bodies.count; ++j) {
    const double square = norm2(vector_at(bodies.positions + 3 * j) - p);
    if (!(square < most * most) || !bodies.own[j]) continue;
    const double speed = norm(velocity - vector_at(bodies.velocities + 3 * j));
    if (std::sqrt(square) < reach + bodies.radii[j] + speed * horizon) return true;
  }
  return false;
}

// Returns true if body `i` came near a solid one, of which none has a larger radius and motion than `most` [m].
bool touches_any(std::size_t i, const SteppedBodies& bodies, double slack, double most) {
  const Vec3 position = vector_at(bodies.positions + 3 * i), moved = vector_at(bodies.moved + 3 * i);
  const double reach = bodies.radii[i] + slack, farthest = reach + norm(moved) + most;
  for (std::size_t j = 0; j < bodies.count; ++j) {
    const double square = norm2(position - vector_at(bodies.positions + 3 * j));
    if (!(square < farthest * farthest) || !bodies.solid[j] || i == j) continue;
    const double near = reach + bodies.radii[j] + norm(moved - vector_at(bodies.moved + 3 * j));
    if (square < near * near) return true;
  }
  return false;
}

}  // namespace

void take_position(const double* found, double* position, double* moved) {
  for (int axis = 0; axis < 3; ++axis) moved[axis] = found[axis] - position[axis], position[axis] = found[axis];
}

void take_state(const double* found, double dt, double* state, double* position, double* moved) {
  std::copy_n(found, BODY_COLUMNS, state), std::copy_n(found, 3, position);
  for (int axis = 0; axis < 3; ++axis) moved[axis] = found[7 + axis] * dt;
}

void extrapolate(const double* state, double duration, double* moved) {
  std::copy_n(state, BODY_COLUMNS, moved);
  for (int axis = 0; axis < 3; ++axis) moved[axis] += duration * state[7 + axis];
  const Vec3 spin = vector_at(state + 10);
  const double speed = norm(spin);
  if (!(speed > 0.0)) return;
  const Vec3 axis = spin * (std::sin(0.5 * speed * duration) / speed);
  const Turn turned = Turn{axis.x, axis.y, axis.z, std::cos(0.5 * speed * duration)} *
                      Turn{state[3], state[4], state[5], state[6]};
  moved[3] = turned.x, moved[4] = turned.y, moved[5] = turned.z, moved[6] = turned.w;
}

void blend(const double* state, const double* target, double share, double* drawn) {
  for (int k = 0; k < BODY_COLUMNS; ++k) drawn[k] = state[k] + share * (target[k] - state[k]);
  double cosine = 0.0, square = 0.0;
  for (int k = 3; k < 7; ++k) cosine += state[k] * target[k];
  const double sign = cosine < 0.0 ? -1.0 : 1.0;  // q and -q are the same rotation: take the shorter way
  for (int k = 3; k < 7; ++k) {
    drawn[k] = (1.0 - share) * state[k] + share * sign * target[k];
    square += drawn[k] * drawn[k];
  }
  for (int k = 3; k < 7; ++k) drawn[k] /= std::sqrt(square);
}

void find_near(const RemoteBodies& remote, double duration, const OwnBodies& bodies, double horizon, bool* near) {
  const Extent extent = extent_of(bodies);
  const Vec3 &low = extent.bounds.low, &high = extent.bounds.high;
  for (std::size_t i = 0; i < remote.count; ++i) {
    const double* state = remote.states + BODY_COLUMNS * i;
    const Vec3 velocity = vector_at(state + 7), p = vector_at(state) + duration * velocity;
    const double reach = remote.radii[i] + remote.margins[i];
    const double most = reach + extent.largest + (norm(velocity) + extent.fastest) * horizon;
    const bool outside = p.x < low.x - most || p.x > high.x + most || p.y < low.y - most || p.y > high.y + most;
    near[i] = !outside && is_near_any(p, velocity, reach, most, bodies, horizon);
  }
}

void find_touching(const SteppedBodies& bodies, double slack, bool* found) {
  double most = 0.0;  // largest radius and motion of a solid body [m]
  for (std::size_t j = 0; j < bodies.count; ++j)
    if (bodies.solid[j]) most = std::max(most, bodies.radii[j] + norm(vector_at(bodies.moved + 3 * j)));
  for (std::size_t i = 0; i < bodies.count; ++i) found[i] = bodies.guests[i] && touches_any(i, bodies, slack, most);
}

}  // namespace smartmesh
