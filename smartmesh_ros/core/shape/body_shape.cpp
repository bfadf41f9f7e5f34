#include "shape/body_shape.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace smartmesh {

namespace {

double core_radius(ShapeKind kind, const Vec3& half) {
  return kind == ShapeKind::Cylinder ? std::hypot(half.x, half.z) : norm(half);
}

// Returns the box around some parts.
Shape box_around(const std::vector<ShapePart>& parts, double radius) {
  Bounds bounds;
  for (const ShapePart& part : parts) {
    Shape shape = part.shape;
    if (shape.kind == ShapeKind::Cylinder) shape.kind = ShapeKind::Box;  // which holds it
    const Vec3 half = Solid(shape, {}).half_extents();
    bounds.add(shape.offset - half), bounds.add(shape.offset + half);
  }
  Shape box;
  box.kind = ShapeKind::Compound;
  box.half = (bounds.high - bounds.low) * 0.5, box.offset = (bounds.low + bounds.high) * 0.5;
  box.bounding_radius = radius;
  return box;
}

}  // namespace

ShapePart primitive_part(ShapeKind kind, const Vec3& half, double rounding, const BodyPose& pose) {
  return {{kind, half, rounding, pose.at, pose.orientation, core_radius(kind, half) + rounding}, pose.at, {}};
}

ShapePart hull_part(const std::vector<Vec3>& points, double rounding) {
  Bounds bounds;
  for (const Vec3& point : points) bounds.add(point);
  const Vec3 middle = (bounds.low + bounds.high) * 0.5;
  ShapePart part{{ShapeKind::Hull, (bounds.high - bounds.low) * 0.5, rounding, middle}, {}, {}};
  double farthest = 0.0;
  for (const Vec3& point : points) {
    part.vertices.push_back(point - middle);
    part.inside = part.inside + point * (1.0 / static_cast<double>(points.size()));
    farthest = std::max(farthest, norm(part.vertices.back()));
  }
  part.shape.bounding_radius = farthest + rounding;
  return part;
}

BodyShape::BodyShape(std::vector<ShapePart> of) : parts(std::move(of)) {
  for (const ShapePart& part : parts) radius = std::max(radius, norm(part.shape.offset) + part.shape.bounding_radius);
  outline = parts.size() == 1 ? parts[0].shape : box_around(parts, radius);
}

double BodyShape::lowest(const BodyPose& body, const Vec3& up) const {
  double least = INFINITE;
  for (const ShapePart& part : parts) {
    const Solid solid(part.shape, body);
    if (part.vertices.empty()) {
      least = std::min(least, dot(up, solid.centre) - solid.extent_along(-up));
      continue;
    }
    const Vec3 own = solid.axes * up;
    for (const Vec3& vertex : part.vertices)
      least = std::min(least, dot(up, solid.centre) + dot(own, vertex) - part.shape.rounding);
  }
  return least;
}

}  // namespace smartmesh
