#include "soil_in_step.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include "contact_points.h"

namespace smartmesh {

namespace {

// Share of a cylinder's radius at which vertices of its hull count as on its rim; PyBullet gives URDF cylinders 32.
constexpr double ON_RIM = 0.97;
// Depths of contacts that the solver is told [m]: it corrects deeper ones apart from their forces.
constexpr double LEAST_DEPTH = 1e-3, MOST_DEPTH = 0.03;
// Motion between two steps from which a body was moved by somebody else [m].
constexpr double MOVED = 1e-4;
// Speed of a body that appears near the soil from which it falls onto it [m/s]: that of a fall from 1 cm. A slower one is
// set down.
constexpr double FALLEN = 0.45;
// Speed of a body that was set down at which it rests, as a share of that of a fall from the depth of its sinkage.
constexpr double AT_REST = 0.005;
// Largest distance of contacts from what Bullet keeps in a manifold [m]: none is dropped by its distance.
constexpr double FARTHEST = 1e9;

double along(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

// Returns a contact whose row in Bullet's solver is the spring: v + J / (slope dt) = speed + force / slope, with the
// impulse J and the speed v at the end of the step.
btManifoldPoint point_of(const SoilSpring& spring, const btCollisionObject& body, const btCollisionObject& ground,
                         bool ground_is_b, double dt, double slop) {
  const double bias = spring.speed + spring.force / spring.slope;
  const double depth = std::min(std::max(spring.sunk, LEAST_DEPTH), MOST_DEPTH);
  const double distance = (bias > 0.0 ? -depth : -bias * dt) - slop;
  const btVector3 at = to_bullet(spring.point), normal = to_bullet(spring.normal);
  const btVector3 in_body = body.getWorldTransform().invXform(at), in_ground = ground.getWorldTransform().invXform(at);
  btManifoldPoint point = ground_is_b ? btManifoldPoint(in_body, in_ground, normal, distance)
                                      : btManifoldPoint(in_ground, in_body, -normal, distance);
  point.m_positionWorldOnA = point.m_positionWorldOnB = at;
  point.m_combinedFriction = spring.friction;
  point.m_combinedRestitution = point.m_combinedRollingFriction = point.m_combinedSpinningFriction = 0.0;
  point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_ERP | BT_CONTACT_FLAG_HAS_CONTACT_CFM;
  point.m_contactERP = bias > 0.0 ? bias * dt / depth : 1.0;
  point.m_contactCFM = 1.0 / spring.slope;
  btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
  return point;
}

}  // namespace

PressingShape pressing_shape(const Convex& convex) {
  if (convex.kind != ShapeKind::Hull) return {convex, {}};
  Bounds bounds;
  for (const Vec3& vertex : convex.core.vertices) bounds.add(vertex);
  const Vec3 centre = (bounds.low + bounds.high) * 0.5, half = (bounds.high - bounds.low) * 0.5;
  const double margin = convex.rounding;
  PressingShape found;
  found.pose.at = centre;
  for (int axis = 0; axis < 3; ++axis) {
    const int one = (axis + 1) % 3, other = (axis + 2) % 3;
    const double radius = std::max(along(half, one), along(half, other));
    const bool is_round = std::all_of(convex.core.vertices.begin(), convex.core.vertices.end(), [&](const Vec3& vertex) {
      const double out = std::hypot(along(vertex - centre, one), along(vertex - centre, other));
      return ON_RIM * radius < out && out < radius / ON_RIM;
    });
    if (!is_round) continue;
    found.shape.kind = ShapeKind::Cylinder;
    found.shape.half = {radius + margin, radius + margin, along(half, axis) + margin};
    const Mat3 identity;
    found.pose.turn = transpose({{identity.row[one], identity.row[other], identity.row[axis]}});
    return found;
  }
  found.shape.kind = ShapeKind::Box;
  found.shape.half = half + Vec3{margin, margin, margin};
  return found;
}

MovingSolid SoilInStep::moving(const SoilPart& part, const Pose& pose, const OnSoil& on) const {
  MovingSolid found;
  found.solid.shape = &part.shape.shape;
  found.solid.centre = pose.at - Vec3{0.0, 0.0, on.rise};
  found.solid.axes = transpose(pose.turn);
  found.linear = on.linear + cross(on.angular, pose.at - on.centre);
  found.angular = on.angular;
  if (norm2(on.belt) > 0.0) found.surface = -surface_velocity(on.belt, {0.0, 0.0, 1.0});
  return found;
}

bool SoilInStep::is_under(const Vec3& point, double time) const {
  const HeightGrid& map = lattice.map();
  const GridPoint at = to_grid(map.pose_at(time), map.resolution, point.x, point.y);
  return at.row >= 0.0 && at.column >= 0.0 && at.row <= map.rows - 1 && at.column <= map.columns - 1;
}

double SoilInStep::rise_at(const Vec3& point, double time) const {
  const HeightGrid& map = lattice.map();
  if (!map.moves(time)) return 0.0;
  const GridPoint at = to_grid(map.pose_at(time), map.resolution, point.x, point.y);
  const int row = static_cast<int>(std::lround(at.row)), column = static_cast<int>(std::lround(at.column));
  if (!map.has(row, column)) return 0.0;
  const double rise = GridReader(map, time, 0.0).read(row, column).height - map.z - map.heights[map.index(row, column)];
  return std::isfinite(rise) ? rise : 0.0;
}

void SoilInStep::touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground, const Convex& convex,
                       const Pose& pose, const OnSoil& on, double slop, SoilPart& part, btPersistentManifold& manifold) {
  if (part.step == 0) part.shape = pressing_shape(convex);
  const Pose now = pose * part.shape.pose;
  part.pose = seen_from(on.pose, now);
  const MovingSolid solid = moving(part, now, on);
  const SoilStep step{on.time, on.duration, step_};
  Carried carried{on.mass, on.mass * on.gravity, false};
  const int before = manifold.getNumContacts();
  const bool was_moved = part.step == 0 || !(norm(now.at - part.at) < MOVED);
  if (was_moved) {
    under_.make_room(lattice, solid, step), part.rim.reset();
    part.is_set_down = norm(solid.linear) < FALLEN;
  }
  carried.is_set_down = part.is_set_down;
  if (was_near(part) && !was_moved && before > 0 && before == static_cast<int>(part.up.size())) {
    double up = 0.0;
    for (int k = 0; k < before; ++k) up += manifold.getContactPoint(k).m_appliedImpulse * part.up[k];
    carried.load = std::max(0.0, (up - on.mass * (solid.linear.z - part.speed)) / on.duration);
  }
  const auto& springs = under_.find_springs(lattice, solid, carried, part.rim, step);
  const bool ground_is_b = manifold.getBody0() == body.getCollisionObject();
  manifold.setContactBreakingThreshold(FARTHEST);
  part.up.clear();
  for (SoilSpring spring : springs) {
    spring.point.z += on.rise;
    const int k = static_cast<int>(part.up.size());
    btManifoldPoint point =
        point_of(spring, *body.getCollisionObject(), *ground.getCollisionObject(), ground_is_b, on.duration, slop);
    if (norm2(on.belt) > 0.0) run_on(surface_velocity(on.belt, spring.normal) * on.anchor_time, ground_is_b, point);
    if (k < before) point.m_appliedImpulse = manifold.getContactPoint(k).m_appliedImpulse, point.m_lifeTime = 1;
    manifold.getContactPoint(k) = point;
    part.up.push_back(spring.normal.z);
  }
  manifold.setNumContacts(static_cast<int>(springs.size()));
  part.speed = solid.linear.z;
  part.step = step_;
}

void SoilInStep::press(const OnSoil& on, SoilParts& parts) {
  for (auto& [shape, part] : parts) {
    if (part.step != step_) {  // it left the ground
      part.rim.reset(), part.sums = {};
      continue;
    }
    const Pose now = on.pose * part.pose;
    const SoilStep step{on.time, on.duration, step_};
    const MovingSolid solid = moving(part, now, on);
    part.sums = under_.press(lattice, solid, part.rim, step);
    part.at = now.at;
    if (std::abs(solid.linear.z) < AT_REST * std::sqrt(on.gravity * part.sums.sinkage)) part.is_set_down = false;
  }
}

}  // namespace smartmesh
