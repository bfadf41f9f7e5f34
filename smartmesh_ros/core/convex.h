// Convex shapes of bodies: a polytope grown by a radius, or a cylinder.
//
// A ball is a point grown by its radius, a capsule a segment. Bullet's hulls are polytopes grown by a margin.
#pragma once

#include <vector>

#include "vec3.h"

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

// Shape of a body in its own frame. `radius`: by which `core` is grown; of a cylinder its radius. `half`: half the length
// of a cylinder along `axis`, whose core is empty.
struct Convex {
  Polytope core;
  double radius = 0.0;
  bool cylinder = false;
  Vec3 axis{0.0, 0.0, 1.0};
  double half = 0.0;
  Bounds bounds;      // in the shape's frame, grown by the radius
  double reach = 0.0; // largest distance of a point of the shape from its origin
  Vec3 centre;        // a point inside, the mean of the core's vertices
};

// Returns the least dot(n, p) of all points of a shape; `n`: unit, in the shape's frame.
double lowest(const Convex& shape, const Vec3& n);

// Returns true if the segment from `p` to `q` (in the shape's frame) passes through the core, or through a cylinder. A
// core without faces is passed by all.
bool is_passed(const Convex& shape, const Vec3& p, const Vec3& q);

Convex ball(double radius);
Convex capsule(double radius, double half, const Vec3& axis);
Convex cylinder(double radius, double half, const Vec3& axis);
Convex box(const Vec3& half);

// Returns a polytope grown by `radius` from its corners and the loops of its faces, counterclockwise seen from outside.
// Faces of a loop without area are left out, and edges between faces in one plane.
Convex hull(const std::vector<Vec3>& corners, const std::vector<std::vector<int>>& loops, double radius);

}  // namespace smartmesh
