// Soil in each step of Bullet's world: its law is that of the contacts.
#pragma once

#include <unordered_map>
#include <vector>

#include <BulletCollision/CollisionShapes/btCollisionShape.h>

#include "convert.h"
#include "soil_contact.h"

class btPersistentManifold;
struct btCollisionObjectWrapper;

namespace smartmesh {

// A convex shape as it presses the soil: a box, ball, cylinder or capsule, or the cylinder or box around a hull. `pose`:
// of its frame in that of the convex shape.
struct PressingShape {
  Shape shape;
  Pose pose;
};
PressingShape pressing_shape(const Convex& convex);

// A part of a body that came near the soil.
struct SoilPart {
  PressingShape shape;
  Pose pose;  // of the pressing shape in the body's frame
  ShearedRim rim;
  SoilSums sums;
  Vec3 at;                 // its middle after the last step [m]
  double speed = 0.0;      // of its middle, upwards, at the start of the last step [m/s]
  std::int32_t step = 0;   // in which it last was near the soil
  bool is_set_down = false;  // put onto the soil without a fall, and not at rest there yet
  std::vector<double> up;  // vertical parts of the normals of its contacts
};
using SoilParts = std::unordered_map<const btCollisionShape*, SoilPart>;

// A body near the soil at the start or the end of a step. Velocities are relative to the ground, that of the point
// `centre` [m]. `mass` [kg]: of what rests on each part of it alone. `rise` [m]: of the ground there since its last map.
// `belt`, `anchor_time`: as in Touching.
struct OnSoil {
  Pose pose;
  Vec3 linear, angular, centre, belt;
  double mass, gravity, duration, time, rise, anchor_time;  // [m/s^2], [s]
};

class SoilInStep {
 public:
  SoilInStep(const HeightGrid& map, const Soils& soils, double spacing) : lattice(map, soils, spacing) {}

  SoilLattice lattice;

  bool is_under(const Vec3& point, double time) const;
  // Returns how far the ground near a point has moved up since its last map [m].
  double rise_at(const Vec3& point, double time) const;
  // Replaces the contacts of a part of a body, a convex shape at `pose`, by those with the soil. `slop` [m]: depth that
  // Bullet's solver leaves.
  void touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground, const Convex& convex,
             const Pose& pose, const OnSoil& on, double slop, SoilPart& part, btPersistentManifold& manifold);
  // Presses the soil to where the parts of an awake body are at the end of a step.
  void press(const OnSoil& on, SoilParts& parts);

  // Counts the steps, from 2 on: the first has none before it.
  void next() { ++step_; }
  // Returns true if a part is near the soil in the last step.
  bool was_near(const SoilPart& part) const { return part.step == step_ - 1; }

 private:
  MovingSolid moving(const SoilPart& part, const Pose& pose, const OnSoil& on) const;

  std::int32_t step_ = 2;
  SoilUnderBody under_;
};

}  // namespace smartmesh
