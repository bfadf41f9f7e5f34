#include "bullet/soil_in_step.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include "map/grid_facet.h"

namespace smartmesh {

namespace {

// Share of a cylinder's radius at which vertices of its hull count as on its rim; PyBullet gives URDF cylinders 32.
constexpr double ON_RIM = 0.97;
// Motion between two steps from which a body was moved by somebody else [m].
constexpr double MOVED = 1e-4;
// Speed of a body that appears near the soil from which it falls onto it [m/s]: that of a fall from 1 cm. A slower one
// is set down.
constexpr double FALLEN = 0.45;
// Speed of a body that was set down at which it rests, as a share of that of a fall from the depth of its sinkage.
constexpr double AT_REST = 0.005;

}  // namespace

Shape pressing_shape(const Convex& convex) {
  Shape found = convex;
  found.offset = {}, found.orientation = {};
  if (convex.kind != ShapeKind::Hull) return found;
  Bounds bounds;
  for (const Vec3& vertex : convex.core.vertices) bounds.add(vertex);
  const Vec3 centre = (bounds.low + bounds.high) * 0.5, half = (bounds.high - bounds.low) * 0.5;
  const double margin = convex.rounding;
  found.offset = centre, found.rounding = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int one = (axis + 1) % 3, other = (axis + 2) % 3;
    const double radius = std::max(component(half, one), component(half, other));
    const bool is_round =
        std::all_of(convex.core.vertices.begin(), convex.core.vertices.end(), [&](const Vec3& vertex) {
          const double out = std::hypot(component(vertex - centre, one), component(vertex - centre, other));
          return ON_RIM * radius < out && out < radius / ON_RIM;
        });
    if (!is_round) continue;
    found.kind = ShapeKind::Cylinder;
    found.half = {radius + margin, radius + margin, component(half, axis) + margin};
    found.orientation = FROM_Z[axis];
    return found;
  }
  found.kind = ShapeKind::Box;
  found.half = half + Vec3{margin, margin, margin};
  return found;
}

MovingSolid SoilInStep::moving(const SoilPart& part, const Pose& pose, const OnSoil& on) const {
  MovingSolid found;
  found.solid.shape = &part.shape;
  const Pose seen = seen_from(on.soil.since, pose);
  found.solid.centre = seen.at;
  found.solid.axes = transpose(seen.rotation);
  found.linear = transposed(on.soil.since.rotation, on.approach.velocity_at(pose.at));
  found.angular = transposed(on.soil.since.rotation, on.approach.angular);
  if (norm2(on.belt) > 0.0) found.surface = -surface_velocity(on.belt, {0.0, 0.0, 1.0});
  return found;
}

double SoilInStep::within_map(const Vec3& point, double time) const {
  const HeightGrid& map = lattice.map();
  const GridPoint at = to_grid(map.pose_at(time), map.resolution, point.x, point.y);
  return std::min({at.row, at.column, map.rows - 1 - at.row, map.columns - 1 - at.column}) * map.resolution;
}

// The cells of a map are soil where all of their corners have heights: so have the fine samples in them.
bool SoilInStep::is_all_around(const Vec3& point, double radius, double time) const {
  return is_ground_around(lattice.map(), lattice.map().pose_at(time), point, radius);
}

double SoilInStep::below_map(const Vec3& point, double time) const {
  const GridPoint at = to_grid(lattice.map().pose_at(time), lattice.spacing(), point.x, point.y);
  const double row = std::round(at.row), column = std::round(at.column);
  const bool has = row >= 0.0 && column >= 0.0 && row < lattice.rows() && column < lattice.columns();
  return has ? lattice.below_map(static_cast<int>(row), static_cast<int>(column), step_ - 1) : 0.0;
}

// Ground whose samples rise unequally tilts: that is a rotation of its normal, not of its samples.
SoilMotion SoilInStep::motion_around(const Vec3& point, double radius, double time, double ahead) const {
  SoilMotion found;
  const HeightGrid& map = lattice.map();
  if (!map.moves(time)) return found;
  const GridPose pose = map.pose_at(time);
  const GridPoint at = to_grid(pose, map.resolution, point.x, point.y);
  const int row = static_cast<int>(std::lround(at.row)), column = static_cast<int>(std::lround(at.column));
  if (!map.has(row, column)) return found;
  GridReader reader(map, time, ahead);
  // Heights of a sample: in the last map, now, and after the time ahead.
  const auto heights_of = [&](int r, int c) {
    const Sample sample = reader.read(r, c);
    return Vec3{map.z + map.heights[map.index(r, c)], sample.height, sample.height + sample.rise};
  };
  Vec3 heights = heights_of(row, column);
  if (!std::isfinite(norm2(heights))) return found;
  const int away = std::max(1, static_cast<int>(std::lround(radius / map.resolution)));
  const int top = std::max(0, row - away), bottom = std::min(map.rows - 1, row + away);
  const int left = std::max(0, column - away), right = std::min(map.columns - 1, column + away);
  Vec3 along = (heights_of(row, right) - heights_of(row, left)) * (1.0 / ((right - left) * map.resolution));
  Vec3 across = (heights_of(bottom, column) - heights_of(top, column)) * (1.0 / ((bottom - top) * map.resolution));
  if (!std::isfinite(norm2(along))) along = {};
  if (!std::isfinite(norm2(across))) across = {};
  heights = heights + (along * (at.column - column) + across * (at.row - row)) * map.resolution;
  const auto normal = [&](double x, double y) {
    return unit({pose.sin * y - pose.cos * x, -pose.sin * x - pose.cos * y, 1.0});
  };
  const Vec3 before = normal(along.x, across.x), now = normal(along.y, across.y), then = normal(along.z, across.z);
  found.middle = {point.x, point.y, heights.y};
  const Vec3 slide = pose.mean_slide(point.x, point.y, ahead), tilt = cross(now, then) * (1.0 / ahead);
  found.velocity = {slide.x, slide.y, (heights.z - heights.y) / ahead};
  found.angular = {tilt.x, tilt.y, tilt.z + pose.spin};
  found.since.rotation = rotation_between(before, now);
  found.since.at = found.middle - found.since.rotation * Vec3{point.x, point.y, heights.x};
  return found;
}

void SoilInStep::touch(const Convex& convex, const Pose& pose, const OnSoil& on, SoilPart& part,
                       std::vector<Contact>& contacts, std::vector<ContactRow>& rows) {
  if (part.step == 0) part.shape = pressing_shape(convex);
  const Pose now = pose * pose_of(part.shape);
  part.pose = seen_from(on.pose, now);
  const MovingSolid solid = moving(part, now, on);
  const double dt = on.approach.duration;
  const bool was_moved = part.step == 0 || !(norm(now.at - part.at) < MOVED);
  const bool slept = !was_moved && !was_near(part);
  const SoilStep step{on.time, dt, step_, slept ? 0 : step_ - 1};
  if (was_moved) {
    under_.make_room(lattice, solid, step), part.rim.reset();
    part.is_set_down = norm(solid.linear) < FALLEN;
  }
  if (was_moved || !(part.sums.area > 0.0)) part.load = {0.0, 0.0, -on.mass * norm(on.approach.gravity)};
  const Carried carried{on.mass, {part.load.x, part.load.y, std::min(0.0, part.load.z)}, part.is_set_down != 0.0};
  const auto& springs = under_.find_springs(lattice, solid, carried, part.rim, step);
  contacts.clear(), rows.clear(), part.levers.clear();
  for (const SoilSpring& spring : springs) {
    // v + J / (slope dt) = speed + force / slope, with the impulse J and the speed v at the end of the step.
    const double speed = spring.speed + spring.force / spring.slope;
    Contact contact{on.soil.since.to_world(spring.point), on.soil.since.rotation * spring.normal,
                    std::max(0.0, -speed * dt), static_cast<int>(contacts.size()), 0};
    contact.ground = {on.soil.velocity_at(contact.point), on.soil.angular};
    ContactRow row;
    row.at = contact.point, row.normal = contact.normal;
    row.speed = speed + dot(contact.normal, contact.ground.velocity);
    row.softness = 1.0 / (spring.slope * dt);
    row.slide = contact.ground.velocity;
    if (norm2(on.belt) > 0.0) row.slide = row.slide + surface_velocity(on.belt, contact.normal);
    row.friction.sliding = spring.friction;
    contacts.push_back(contact), rows.push_back(row);
    part.levers.push_back(lever_at(solid.solid, spring.point - solid.solid.centre, spring.normal));
  }
  part.velocity = velocity_of(solid);
}

void SoilInStep::press(const OnSoil& on, SoilParts& parts) {
  for (auto& [number, part] : parts) {
    if (part.contacts == nullptr) {  // it left the ground
      part.rim.reset(), part.sums = {};
      continue;
    }
    part.step = step_;
    const Pose now = on.pose * part.pose;
    const SoilStep step{on.time, on.approach.duration, step_, step_ - 1};
    const MovingSolid solid = moving(part, now, on);
    part.sums = under_.press(lattice, solid, part.rim, step);
    part.at = now.at;
    Vec3 change = inertia_of(solid.solid, on.mass) * (velocity_of(solid) - part.velocity);
    for (std::size_t k = 0; k < part.levers.size(); ++k)
      change = change - part.levers[k] * part.contacts->getContactPoint(static_cast<int>(k)).m_appliedImpulse;
    part.load = change * (1.0 / on.approach.duration);
    if (std::abs(solid.linear.z) < AT_REST * std::sqrt(norm(on.approach.gravity) * part.sums.sinkage))
      part.is_set_down = 0.0;
  }
}

}  // namespace smartmesh
