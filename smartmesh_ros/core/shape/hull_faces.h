// Faces of the convex hull of points.
#pragma once

#include <vector>

#include "math/vec3.h"

namespace smartmesh {

// Returns the faces of the convex hull as loops of indices, counterclockwise seen from outside. Points that are outside
// the hull of the others by at most `tolerance` [m] are not corners, so that points of a plane or a line leave no
// slivers. Flat points have two faces, points on a line none.
std::vector<std::vector<int>> hull_faces(const std::vector<Vec3>& points, double tolerance);

}  // namespace smartmesh
