// Reader of a moving triangle mesh of any form: what lies near a body, and the ground under a point.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "map/clock_updates.h"
#include "map/height_grid.h"
#include "map/untouched.h"
#include "math/box_tree.h"
#include "mesh/mesh_topology.h"
#include "mesh/patch.h"

namespace smartmesh {

// Ground at a point: height [m], NaN = none, and mean velocity over a duration, with horizontal motion [m/s].
struct GroundPoint {
  double height = NONE;
  Vec3 velocity;
};

// The same with the unit normal towards the side of the bodies, age [s], the time since the last map of the place,
// negative before it, coefficient of friction, and whether it is of a mesh.
struct GroundSample : GroundPoint {
  Vec3 normal;
  double age = NONE, friction = Material{}.friction;
  bool on_mesh = false;
};

// Where a ray meets the ground: distance [m], infinity = nowhere, and the unit normal there.
struct RayHit {
  double distance = INFINITE;
  Vec3 normal;
};

// Which vertices and edges of a mesh a patch has already. A surface has one for all its meshes.
struct MeshScratch {
  std::vector<int> found, edges, peaks;
  std::vector<int> point_of;  // place in the patch of each vertex, valid if its stamp is the present one
  std::vector<std::int64_t> stamp_of_vertex, stamp_of_edge, stamp_of_peak;
  std::int64_t stamp = 0;

  void begin(std::size_t vertices, std::size_t edges);
};

// Its parts have the meanings of TriangleMesh in terrain/trimesh.py.
struct MeshSurface : MotionRules {
  int vertices, triangle_count;
  const std::int64_t* triangles;                 // belong to Python
  std::vector<double> now;                       // positions at the last update, (3, vertices)
  Untouched<double> velocities, offsets, rates;  // (KEPT, 3, vertices), and (3, vertices) as those of HeightGrid
  Clock clock{};
  long revision = 0;  // changes with every update

  MeshSurface(const double* positions, int count, const std::int64_t* corners, int of_corners);

  // Must be called after the arrays have changed.
  void update();
  // Measures the motion of the vertices; part of `update`.
  void measure();

  // Returns true if any vertex may move at `time` [s].
  bool moves(double time) const;

  // Adds the facets inside `bounds` at `time` [s] that are in `reach`, and their convex edges and peaks. Velocities are
  // means over the time `ahead` [s]; zero = they are not read. `number`: of the mesh, for the names of points.
  void gather(const Bounds& bounds, double time, double ahead, const Reach& reach, int number, MeshScratch& scratch,
              Patch& patch) const;
  // Adds the velocities of the facets that come into `bounds` within the time `ahead` [s] to `speeds`.
  void add_velocities(const Bounds& bounds, double time, double ahead, MeshScratch& scratch, Bounds& speeds) const;

 private:
  friend class MeshReader;
  double drift(double time) const;

  std::vector<Vec3> points_;  // positions at the last update, vertex by vertex
  MeshTopology topology_;
  BoxTree tree_;
  // Largest of a vertex along an axis [m/s], [m/s^2], [m], [m/s].
  double speed_ = 0.0, acceleration_ = 0.0, offset_ = 0.0, rate_ = 0.0;
};

// New positions (3, count) [m] of the vertices `chosen` (count,), null = of all, at `time` [s], and their `velocities`
// [m/s], null = not given.
struct NewVertices {
  const std::int64_t* chosen;
  const double* positions;
  const double* velocities;
  std::ptrdiff_t count;
  double time;
};

// Writes new vertices to a mesh; see `take_heights`. Vertices that are not chosen are at rest for that interval.
void take_vertices(MeshSurface& mesh, const NewVertices& fresh, const Intervals& intervals);

}  // namespace smartmesh
