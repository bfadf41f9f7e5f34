// The one reader of moving ground: tiles of height maps, the gaps between them, meshes, and what lies near a body.
#pragma once

#include <vector>

#include "mesh_surface.h"
#include "patch.h"
#include "window.h"

namespace smartmesh {

// Ground under a point: height [m] (NaN = none) and mean vertical velocity [m/s] over a duration.
struct GroundPoint {
  double height, velocity;
};

// Duration over which a velocity is that of an instant [s], as in terrain/moving_grid.py.
constexpr double INSTANT = 1e-9;
// Height of a point above all ground [m].
constexpr double ABOVE_ALL = 1e300;

// Velocity of the ground near a point, as that of a rigid body: `linear` [m/s] at the ground under the point, `angular`
// [rad/s] from the gradient of the vertical velocity, or of the mesh's facet there. `foot` [m]: the ground under the point.
struct GroundMotion {
  bool known = false;
  Vec3 foot, linear, angular;
};

class Surface {
 public:
  // The first height map that has ground at a point counts there. The seam between two meshes is an edge of both, which
  // bodies feel; the parts of one mesh join where they abut.
  void set_tiles(const std::vector<const HeightGrid*>& tiles, const std::vector<const MeshSurface*>& meshes);

  // Fills `patch` with the ground of height maps, or of meshes, inside `bounds` at `time` [s], as far as it is in `reach`.
  void gather(const Bounds& bounds, double time, const Reach& reach, Patch& patch);
  void gather_meshes(const Bounds& bounds, double time, const Reach& reach, Patch& patch);

  // Returns the highest ground at (x, y) at `time` [s], with mean velocities over the time `ahead` [s]. Ground of meshes
  // above `z` [m] does not count. Gaps of up to a cell between two tiles are bridged.
  GroundPoint at(double x, double y, double time, double ahead, double z = ABOVE_ALL) const;

  // Returns the motion of that ground over the time `ahead` [s]; the gradient of height maps is taken over `half` [m] to
  // each side.
  GroundMotion motion_at(double x, double y, double half, double time, double ahead, double z = ABOVE_ALL) const;

  // Returns a number that grows with every change of the tiles or their samples.
  long revision() const;
  // Returns true if any ground may move at `time` [s].
  bool moves(double time) const;
  // Returns a height that no ground inside `bounds` exceeds at `time` [s]; -1e300 = no ground.
  double highest_under(const Bounds& bounds, double time);
  // Writes the heights of the samples inside `bounds` at `time` [s], and the coordinates of the vertices of facets there.
  void heights_under(const Bounds& bounds, double time, std::vector<double>& heights);

 private:
  std::vector<const HeightGrid*> tiles_;
  double widest_cell() const;
  // Returns bounds that hold the tiles on both sides of each gap that is bridged inside `bounds`.
  Bounds with_gaps(const Bounds& bounds) const;
  std::vector<const MeshSurface*> meshes_;
  void sample_across(const HeightGrid& finest, const Bounds& bounds, double time);
  GroundPoint tiles_at(double x, double y, double time, double ahead) const;
  MeshPoint meshes_at(double x, double y, double z, double time, double ahead) const;
  GroundPoint bridged(double x, double y, double time, double ahead) const;

  Window window_;
  MeshScratch scratch_;
  long layout_ = 0;
};

// Returns the ground of one grid at a point in samples, interpolated in its facet; points beyond the edge count as on it.
GroundPoint grid_ground(const HeightGrid& grid, GridPoint place, double time, double ahead);

}  // namespace smartmesh
