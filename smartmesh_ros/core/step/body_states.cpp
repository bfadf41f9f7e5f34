#include "step/body_states.h"

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
    if (!bodies.own[j] || std::isnan(bodies.positions[j].x)) continue;
    extent.bounds.add(bodies.positions[j]);
    extent.fastest = std::max(extent.fastest, norm(bodies.velocities[j]));
    extent.largest = std::max(extent.largest, bodies.radii[j]);
  }
  return extent;
}

// Returns true if a body at `p` comes near an own body: its sphere grown by the margin has this `radius` [m].
// Bodies that are farther away than `most` [m] do not.
bool is_near_any(const Vec3& p, const Vec3& velocity, double radius, double most, const OwnBodies& bodies,
                 double horizon) {
  for (std::size_t j = 0; j < bodies.count; ++j) {
    const double square = norm2(bodies.positions[j] - p);
    if (!(square < most * most) || !bodies.own[j]) continue;
    const double speed = norm(velocity - bodies.velocities[j]);
    if (std::sqrt(square) < radius + bodies.radii[j] + speed * horizon) return true;
  }
  return false;
}

// Returns true if body `i` came near a solid one, of which none has a larger radius and motion than `most` [m].
bool touches_any(std::size_t i, const SteppedBodies& bodies, double slack, double most) {
  const Vec3 position = bodies.positions[i], moved = bodies.moved[i];
  const double radius = bodies.radii[i] + slack, farthest = radius + norm(moved) + most;
  for (std::size_t j = 0; j < bodies.count; ++j) {
    const double square = norm2(position - bodies.positions[j]);
    if (!(square < farthest * farthest) || !bodies.solid[j] || i == j) continue;
    const double near = radius + bodies.radii[j] + norm(moved - bodies.moved[j]);
    if (square < near * near) return true;
  }
  return false;
}

}  // namespace

BodyState extrapolated(const BodyState& state, double duration) {
  BodyState moved = state;
  moved.pose.at = state.pose.at + duration * state.linear;
  const double speed = norm(state.angular);
  if (!(speed > 0.0)) return moved;
  const Vec3 axis = state.angular * (std::sin(0.5 * speed * duration) / speed);
  moved.pose.orientation =
      Quaternion{axis.x, axis.y, axis.z, std::cos(0.5 * speed * duration)} * state.pose.orientation;
  return moved;
}

BodyState blended(const BodyState& state, const BodyState& target, double share) {
  const auto between = [&](const Vec3& from, const Vec3& to) { return from + share * (to - from); };
  const Quaternion &a = state.pose.orientation, &b = target.pose.orientation;
  // q and -q are the same rotation: take the shorter way.
  const double of_a = 1.0 - share, of_b = dot(a, b) < 0.0 ? -share : share;
  const Quaternion sum{of_a * a.x + of_b * b.x, of_a * a.y + of_b * b.y, of_a * a.z + of_b * b.z,
                       of_a * a.w + of_b * b.w};
  const double length = std::sqrt(dot(sum, sum));
  return {{between(state.pose.at, target.pose.at), {sum.x / length, sum.y / length, sum.z / length, sum.w / length}},
          between(state.linear, target.linear),
          between(state.angular, target.angular)};
}

void find_near(const RemoteBodies& remote, double duration, const OwnBodies& bodies, double horizon, bool* near) {
  const Extent extent = extent_of(bodies);
  const Vec3 &low = extent.bounds.low, &high = extent.bounds.high;
  for (std::size_t i = 0; i < remote.count; ++i) {
    const Vec3 velocity = remote.states[i].linear, p = remote.states[i].pose.at + duration * velocity;
    const double radius = remote.radii[i] + remote.margins[i];
    const double most = radius + extent.largest + (norm(velocity) + extent.fastest) * horizon;
    const bool outside = p.x < low.x - most || p.x > high.x + most || p.y < low.y - most || p.y > high.y + most;
    near[i] = !outside && is_near_any(p, velocity, radius, most, bodies, horizon);
  }
}

void find_touching(const SteppedBodies& bodies, double slack, bool* found) {
  double most = 0.0;  // largest radius and motion of a solid body [m]
  for (std::size_t j = 0; j < bodies.count; ++j)
    if (bodies.solid[j]) most = std::max(most, bodies.radii[j] + norm(bodies.moved[j]));
  for (std::size_t i = 0; i < bodies.count; ++i) found[i] = bodies.guests[i] && touches_any(i, bodies, slack, most);
}

}  // namespace smartmesh
