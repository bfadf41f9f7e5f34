// The shape of a body or link about its centre of mass.
#pragma once

#include <vector>

#include "shape/solid.h"

namespace smartmesh {

// A convex part of a body. `inside`: a point inside it [m]; `vertices`: of a hull, about the middle of its bounds [m].
struct ShapePart {
  Shape shape;
  Vec3 inside;
  std::vector<Vec3> vertices;
};

// Returns a part whose core has some half extents and no vertices.
ShapePart primitive_part(ShapeKind kind, const Vec3& half, double rounding, const BodyPose& pose);
// Returns the hull of some points, at least one, grown by a rounding radius.
ShapePart hull_part(const std::vector<Vec3>& points, double rounding);

// `parts`: at least one. `outline`: the shape of the one part, or the box around several. `radius`: bounding radius
// about the centre of mass [m].
struct BodyShape {
  std::vector<ShapePart> parts;
  Shape outline;
  double radius = 0.0;

  explicit BodyShape(std::vector<ShapePart> of);
  // Returns the least height of its points along a unit vector at a pose of its body [m].
  double lowest(const BodyPose& body, const Vec3& up = {0.0, 0.0, 1.0}) const;
};

}  // namespace smartmesh
