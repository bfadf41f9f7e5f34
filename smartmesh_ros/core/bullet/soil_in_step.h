// Soil in each step of Bullet's world: its law is that of the contacts.
#pragma once

#include <map>
#include <vector>

#include "contact/contact_row.h"
#include "soil/soil_contact.h"

class btPersistentManifold;

namespace smartmesh {

// Returns how a convex shape presses the soil, placed in its frame: a box, ball, cylinder or capsule as itself, a hull
// as the cylinder or box around it.
Shape pressing_shape(const Convex& convex);

// What a part of a body on the soil knows of the past, as numbers, which are saved. `is_set_down`: it was put onto the
// soil without a fall, and is not at rest there yet. `load` in the last step, as in Carried; `at`: its middle after
// that [m].
struct SoilPartMemory {
  double is_set_down = 0.0;
  Vec3 load, at;
  SoilSums sums;
};

// A part of a body that came near the soil.
struct SoilPart : SoilPartMemory {
  Shape shape;  // as it presses the soil
  Pose pose;    // of the pressing shape in the body's frame
  ShearedRim rim;
  std::int32_t step = 0;  // in which it last was near the soil
  // Within a step: its contacts, the loads of unit impulses at them, and its velocity before them.
  const btPersistentManifold* contacts = nullptr;
  std::vector<Vec3> levers;
  Vec3 velocity;
};
// By their number among the convex parts of the body's shape.
using SoilParts = std::map<int, SoilPart>;

// How the soil near a body moves with its map. `since`: takes a point of the ground from its place in the last map to
// that now. `middle`: a point of the ground [m], and its velocity [m/s]; `angular` [rad/s]: with which the ground turns
// and tilts about it.
struct SoilMotion {
  Pose since{{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}}, {}};
  Vec3 middle, velocity, angular;

  Vec3 velocity_at(const Vec3& p) const { return velocity + cross(angular, p - middle); }
};

// A body near the soil at the start or the end of a step. `approach`: its motion relative to the soil, whose margin
// does not count. `mass` [kg]: of what rests on each part of it alone. `soil`: motion of the soil under it.
// `belt`: as in BodySurface. `time` [s]: of the step.
struct OnSoil {
  Pose pose;
  Approach approach;
  SoilMotion soil;
  Vec3 belt;
  double mass = 0.0, time = 0.0;
};

class SoilInStep {
 public:
  SoilInStep(const HeightGrid& map, const Soils& soils, double spacing) : lattice(map, soils, spacing) {}

  SoilLattice lattice;

  // Returns how far inside the outline of the map a point is [m], negative outside.
  double within_map(const Vec3& point, double time) const;
  // Returns true if there is soil at a point, horizontally; holes of the map have none.
  bool has(const Vec3& point, double time) const { return is_all_around(point, 0.0, time); }
  // Returns true if there is soil all around a point, within a `radius` [m].
  bool is_all_around(const Vec3& point, double radius, double time) const;
  // Returns how far the ground at a point was pressed below its map [m].
  double below_map(const Vec3& point, double time) const;
  // Returns the motion of the soil within a `radius` [m] of a point, with mean velocities over the time `ahead` [s], or
  // before if that is negative.
  SoilMotion motion_around(const Vec3& point, double radius, double time, double ahead) const;
  // Finds the contacts of a part of a body, a convex shape at `pose`, with the soil.
  void touch(const Convex& convex, const Pose& pose, const OnSoil& on, SoilPart& part, std::vector<Contact>& contacts,
             std::vector<ContactRow>& rows);
  // Presses the soil to where the parts of an awake body are at the end of a step.
  void press(const OnSoil& on, SoilParts& parts);

  // Counts the steps, from 2 on: the first has none before it.
  void next() { ++step_; }
  std::int32_t step() const { return step_; }
  void go_on_from(std::int32_t step) { step_ = step; }
  // Returns true if a part is near the soil in the last step.
  bool was_near(const SoilPart& part) const { return part.step == step_ - 1; }

 private:
  MovingSolid moving(const SoilPart& part, const Pose& pose, const OnSoil& on) const;

  std::int32_t step_ = 2;
  SoilUnderBody under_;
};

}  // namespace smartmesh
