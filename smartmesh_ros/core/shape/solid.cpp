#include "shape/solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

bool has_rows(const Shape& shape, std::int64_t count) {
  return shape.rows >= 1 && shape.first >= 0 && shape.rows <= count && shape.first <= count - shape.rows;
}

// Returns the vertex of a hull that is farthest along a direction in its own frame.
const Vec3& farthest_vertex(const Solid& solid, const Vec3& direction) {
  double most = -std::numeric_limits<double>::infinity();
  const Vec3* found = solid.vertices;
  for (const Vec3* vertex = solid.vertices; vertex != solid.vertices + solid.shape->rows; ++vertex) {
    const double far = dot(*vertex, direction);
    if (far > most) most = far, found = vertex;
  }
  return *found;
}

}  // namespace

bool ShapeTable::has_all_of(const Shape& shape) const {
  if (!is_primitive(shape.kind) && shape.kind != ShapeKind::Hull && shape.kind != ShapeKind::Compound) return false;
  if (shape.kind == ShapeKind::Hull) return has_rows(shape, vertex_count);
  if (shape.kind != ShapeKind::Compound) return true;
  if (!has_rows(shape, part_count)) return false;
  return std::all_of(parts + shape.first, parts + shape.first + shape.rows,
                     [&](const Shape& part) { return part.kind != ShapeKind::Compound && has_all_of(part); });
}

Solid::Solid(const Shape& placed, const BodyPose& frame, const Vec3* of_hull)
    : shape(&placed), centre(frame.at + rotated(frame.orientation, placed.offset)), vertices(of_hull) {
  if (shape->kind != ShapeKind::Ball) axes = axes_of(frame.orientation * shape->orientation);
}

Vec3 Solid::core_support(const Vec3& d) const {
  if (shape->kind == ShapeKind::Hull) return farthest_vertex(*this, d);
  const Vec3& half = shape->half;
  if (shape->kind == ShapeKind::Cylinder) {
    const double aside = std::sqrt(d.x * d.x + d.y * d.y), share = aside > 0.0 ? half.x / aside : 0.0;
    return {share * d.x, share * d.y, std::copysign(half.z, d.z)};
  }
  return {std::copysign(half.x, d.x), std::copysign(half.y, d.y), std::copysign(half.z, d.z)};
}

double Solid::extent_along(const Vec3& direction) const {
  const Vec3 d = axes * direction;
  return shape->kind == ShapeKind::Hull ? dot(farthest_vertex(*this, d), d) + shape->rounding : shape->extent(d);
}

double BodySolid::lowest(const Vec3& up) const {
  double least = std::numeric_limits<double>::infinity();
  for (const Solid& part : parts) least = std::min(least, dot(up, part.centre) - part.extent_along(-up));
  return least;
}

void place_shape(const ShapeTable& table, const Shape& shape, const BodyPose& body, BodySolid& placed) {
  const auto place = [&](const Shape& each, const BodyPose& frame) {
    return Solid(each, frame, each.kind == ShapeKind::Hull ? table.vertices + each.first : nullptr);
  };
  placed.whole = place(shape, body);
  placed.parts.clear();
  if (shape.kind != ShapeKind::Compound) {
    placed.parts.push_back(placed.whole);
    return;
  }
  const BodyPose own{placed.whole.centre, body.orientation * shape.orientation};
  for (std::int64_t k = shape.first; k < shape.first + shape.rows; ++k)
    placed.parts.push_back(place(table.parts[k], own));
}

}  // namespace smartmesh
