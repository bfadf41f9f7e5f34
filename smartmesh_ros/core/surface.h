// The one reader of moving ground: tiles of height maps, the gaps between them, and what lies near a body.
#pragma once

#include <vector>

#include "patch.h"
#include "window.h"

namespace smartmesh {

// Ground under a point: height [m] (NaN = none) and mean vertical velocity [m/s] over a duration.
struct GroundPoint {
  double height, velocity;
};

// Velocity of the ground near a point, as that of a rigid body: `linear` [m/s] at the ground under the point, `angular`
// [rad/s] from the gradient of the vertical velocity. `foot` [m]: the ground under the point.
struct GroundMotion {
  bool known = false;
  Vec3 foot, linear, angular;
};

class Surface {
 public:
  // The first tile that has ground at a point counts there.
  void set_tiles(const std::vector<const HeightGrid*>& tiles);

  // Fills `patch` with the ground inside `bounds` at `time` [s], as far as it is in `reach`.
  void gather(const Bounds& bounds, double time, const Reach& reach, Patch& patch);

  // Returns the ground under a point at `time` [s], with mean velocities over the time `ahead` [s]. Gaps of up to a cell
  // between two tiles are bridged.
  GroundPoint at(double x, double y, double time, double ahead) const;

  // Returns the motion of the ground under a point (x, y) over the time `ahead` [s]; its gradient is taken over `half`
  // [m] to each side.
  GroundMotion motion_at(double x, double y, double half, double time, double ahead) const;

  // Returns a number that grows with every change of the tiles or their samples.
  long revision() const;
  // Returns true if any ground may move at `time` [s].
  bool moves(double time) const;
  // Returns a height that no ground inside `bounds` exceeds at `time` [s]; -1e300 = no ground.
  double highest_under(const Bounds& bounds, double time);
  // Writes the heights of the samples inside `bounds` at `time` [s]; NaN = none.
  void heights_under(const Bounds& bounds, double time, std::vector<double>& heights);

 private:
  std::vector<const HeightGrid*> tiles_;
  double widest_cell() const;
  void sample_across(const HeightGrid& finest, const Bounds& bounds, double time);
  GroundPoint bridged(double x, double y, double time, double ahead) const;

  Window window_;
  long layout_ = 0;
};

// Returns the ground of one grid at a point in samples, interpolated in its facet; points beyond the edge count as on it.
GroundPoint grid_ground(const HeightGrid& grid, GridPoint place, double time, double ahead);

}  // namespace smartmesh
