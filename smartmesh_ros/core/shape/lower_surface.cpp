#include "shape/lower_surface.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Returns the lowest point of a shape along a unit vector, both in its frame.
Vec3 lowest_point(const Convex& shape, const Vec3& up) {
  if (shape.kind == ShapeKind::Cylinder) {
    const double level = std::hypot(up.x, up.y), share = level > 0.0 ? shape.half.x / level : 0.0;
    return {-up.x * share, -up.y * share, std::copysign(shape.half.z, -up.z)};
  }
  const std::vector<Vec3>& corners = shape.core.vertices;
  const auto is_lower = [&](const Vec3& a, const Vec3& b) { return dot(a, up) < dot(b, up); };
  return *std::min_element(corners.begin(), corners.end(), is_lower) - up * shape.rounding;
}

}  // namespace

Convex convex_of(const ShapePart& part) {
  const Shape& shape = part.shape;
  switch (shape.kind) {
    case ShapeKind::Box:
      return box(shape.half);
    case ShapeKind::Cylinder:
      return cylinder(shape.half.x, shape.half.z);
    case ShapeKind::Capsule:
      return capsule(shape.rounding, shape.half.z);
    case ShapeKind::Ball:
      return ball(shape.rounding);
    default:
      return hull(part.vertices, shape.rounding);
  }
}

LowerSurface::LowerSurface(const std::vector<BodyShape>& shapes) : links_(shapes.size()) {
  for (std::size_t link = 0; link < links_; ++link)
    for (const ShapePart& part : shapes[link].parts) parts_.push_back({convex_of(part), part.shape, link});
}

Bounds LowerSurface::bounds(const BodyPose* poses) const {
  Bounds found;
  for (const Part& part : parts_) {
    const Solid solid(part.placed, poses[part.link]);
    const Vec3 half = solid.half_extents();
    found.add(solid.centre - half), found.add(solid.centre + half);
  }
  return found;
}

std::vector<double> LowerSurface::find(const BodyPose* poses, const double* points, std::size_t count) const {
  std::vector<double> heights(count, NONE);
  for (const Part& part : parts_) {
    const Solid solid(part.placed, poses[part.link]);
    const double radius = part.placed.bounding_radius;
    const Vec3 up = solid.axes * Vec3{0.0, 0.0, 1.0};
    for (std::size_t k = 0; k < count; ++k) {
      const Vec3 from = Vec3{points[2 * k], points[2 * k + 1], solid.centre.z} - solid.centre;
      if (norm2(from) > radius * radius) continue;
      const double along = first_inside(part.shape, solid.axes * from, up);
      if (std::isfinite(along)) heights[k] = std::fmin(heights[k], solid.centre.z + along);
    }
  }
  return heights;
}

void LowerSurface::add_lowest(const BodyPose* poses, const Vec3& up, std::vector<Vec3>& points) const {
  for (const Part& part : parts_) {
    const Solid solid(part.placed, poses[part.link]);
    points.push_back(solid.centre + transpose(solid.axes) * lowest_point(part.shape, solid.axes * up));
  }
}

}  // namespace smartmesh
