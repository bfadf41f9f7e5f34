// The foot of a body: the point of the ground nearest to it, with the ground's normal and motion there.
#pragma once

#include <cstdint>
#include <vector>

#include "gap.h"
#include "height_grid.h"

namespace smartmesh {

enum class Support : std::int64_t { None = 0, Field = 1, Mesh = 2 };

// The ground under a body, with the layout of the NumPy type SUPPORT in patches/supports.py, which explains the fields.
struct SupportRecord {
  Support state;
  std::int64_t tile, row, column, rows, columns, stride;
  double foot[3], gap, normal[3], rise, turn[3], slide[2], deviation;
};
static_assert(sizeof(SupportRecord) == 168, "the layout of SUPPORT in patches/supports.py");

// Samples of the rectangle of a support, row by row: heights [m], NaN = no ground, and vertical velocities [m/s].
struct FieldSamples {
  const double *heights, *velocities;
  int rows, columns;
};

// Writes the foot of a body on a height map at `pose`, its gap, and the normal and motion of the ground there. The foot
// lies in the plane of the nearest facet, under the body's centre; of a ball, in the facet.
void find_foot(const FieldSamples& samples, const GridPose& pose, double resolution, const BodySolid& body,
               SupportRecord& support);

// Writes the foot of a body on the triangles of a mesh, its gap and the ground's normal. `corners`: three of each triangle.
void find_foot(const std::vector<Vec3>& corners, const BodySolid& body, SupportRecord& support);

}  // namespace smartmesh
