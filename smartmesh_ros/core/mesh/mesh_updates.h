// Taking updates of a moving mesh: new vertices, and velocities estimated from them.
#pragma once

#include "map/clock_updates.h"
#include "mesh/mesh_surface.h"

namespace smartmesh {

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
