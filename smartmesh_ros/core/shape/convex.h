// Convex shapes with the features that contacts need: corners, edges and faces of their cores.
#pragma once

#include <vector>

#include "shape/solid.h"

namespace smartmesh {

// Face of a polytope: dot(normal, p) = offset. Its corners, counterclockwise seen from outside, are
// `Polytope::loops[first]` to `loops[first + count - 1]`.
struct PolyFace {
  Vec3 normal;
  double offset;
  int first, count;
};

// Edge of a polytope. `into`: unit directions from the edge into its two faces, perpendicular to it. A segment has no
// faces: `faces` is then -1.
struct PolyEdge {
  int end[2];
  int faces[2] = {-1, -1};
  Vec3 into[2];
  double half_cosine = 1.0;  // cosine of half the angle between the normals of its faces
};

struct Polytope {
  std::vector<Vec3> vertices;
  std::vector<PolyFace> faces;
  std::vector<int> loops;
  std::vector<PolyEdge> edges;
  std::vector<std::vector<int>> neighbours;  // of each vertex, along the edges
};

// A convex shape in its own frame, with the features of its `core`; that of a cylinder is empty. The middle of a hull
// is anywhere: its `bounding_radius` is about the origin, and it has no `half` extents.
struct Convex : Shape {
  Polytope core;
  Bounds bounds;  // of the shape
  Vec3 centre;    // a point inside, the mean of the core's vertices
};

// Returns the least dot(n, p) of all points of a shape; `n`: unit, in the shape's frame.
double lowest(const Convex& shape, const Vec3& n);

// Returns true if the segment from `p` to `q` (in the shape's frame) passes through the core, through a cylinder, or
// through a capsule beside its axis. A ball is passed by all.
bool is_passed(const Convex& shape, const Vec3& p, const Vec3& q);

// Returns where a line p + t u (in the shape's frame) first is in a shape: t, or infinity if the line misses the shape.
// The edges of a hull are not rounded.
double first_inside(const Convex& shape, const Vec3& p, const Vec3& u);

// Returns the distance of a point from the core of a hull [m], zero inside; a flat hull has no inside.
double distance_outside(const Polytope& hull, const Vec3& p);

Convex ball(double radius);
Convex capsule(double radius, double half);
Convex cylinder(double radius, double half);
Convex box(const Vec3& half);

// Returns the faces of the convex hull as loops of indices, counterclockwise seen from outside. Points that are outside
// the hull of the others by at most `tolerance` [m] are not corners, so that points of a plane or a line leave no
// slivers. Flat points have two faces, points on a line none.
std::vector<std::vector<int>> hull_faces(const std::vector<Vec3>& points, double tolerance);

// Returns the convex hull of some points, at least one, grown by a margin.
Convex hull(const std::vector<Vec3>& points, double margin);

}  // namespace smartmesh
