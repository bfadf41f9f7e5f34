#include "solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

bool has_rows(const ShapeRecord& shape, std::int64_t count) {
  return shape.rows >= 1 && shape.first >= 0 && shape.rows <= count && shape.first <= count - shape.rows;
}

// Returns the row of the hull's vertex that is farthest along a direction in its own frame.
std::int64_t farthest_vertex(const Solid& solid, const Vec3& direction) {
  double most = -std::numeric_limits<double>::infinity();
  std::int64_t found = 0;
  for (std::int64_t k = 0; k < solid.rows; ++k) {
    const double far = dot(solid.vertex(k), direction);
    if (far > most) most = far, found = k;
  }
  return found;
}

Turn own_turn(const ShapeRecord& shape) { return {shape.turn[0], shape.turn[1], shape.turn[2], shape.turn[3]}; }

Solid solid_at(const ShapeTable& table, const ShapeRecord& shape, const Vec3& at, const Turn& turn) {
  Solid solid;
  solid.kind = shape.kind;
  solid.centre = at + rotated(turn, {shape.offset[0], shape.offset[1], shape.offset[2]});
  if (shape.kind != ShapeKind::Ball) solid.axes = axes_of(turn * own_turn(shape));
  solid.half = {shape.half[0], shape.half[1], shape.half[2]};
  solid.rounding = shape.rounding, solid.reach = shape.reach;
  if (shape.kind == ShapeKind::Hull) solid.vertices = table.vertices + 3 * shape.first, solid.rows = shape.rows;
  return solid;
}

}  // namespace

bool ShapeTable::has_all_of(const ShapeRecord& shape) const {
  if (shape.kind < ShapeKind::Ball || shape.kind > ShapeKind::Compound) return false;
  if (shape.kind == ShapeKind::Hull) return has_rows(shape, vertex_count);
  if (shape.kind != ShapeKind::Compound) return true;
  if (!has_rows(shape, part_count)) return false;
  return std::all_of(parts + shape.first, parts + shape.first + shape.rows, [&](const ShapeRecord& part) {
    return part.kind != ShapeKind::Compound && has_all_of(part);
  });
}

Vec3 Solid::core_support(const Vec3& d) const {
  if (kind == ShapeKind::Hull) return vertex(farthest_vertex(*this, d));
  if (kind == ShapeKind::Cylinder) {
    const double aside = std::sqrt(d.x * d.x + d.y * d.y), share = aside > 0.0 ? half.x / aside : 0.0;
    return {share * d.x, share * d.y, std::copysign(half.z, d.z)};
  }
  return {std::copysign(half.x, d.x), std::copysign(half.y, d.y), std::copysign(half.z, d.z)};
}

double Solid::reach_along(const Vec3& direction) const {
  if (kind == ShapeKind::Ball) return rounding;
  const Vec3 d = axes * direction;
  if (kind == ShapeKind::Hull) return dot(vertex(farthest_vertex(*this, d)), d) + rounding;
  if (kind == ShapeKind::Cylinder) return half.x * std::sqrt(d.x * d.x + d.y * d.y) + half.z * std::abs(d.z) + rounding;
  return half.x * std::abs(d.x) + half.y * std::abs(d.y) + half.z * std::abs(d.z) + rounding;
}

double BodySolid::lowest() const {
  double least = std::numeric_limits<double>::infinity();
  for (const Solid& part : parts) least = std::min(least, part.centre.z - part.reach_along({0.0, 0.0, -1.0}));
  return least;
}

void place_shape(const ShapeTable& table, const ShapeRecord& shape, const double* body, BodySolid& placed) {
  const Turn turn{body[3], body[4], body[5], body[6]};
  placed.whole = solid_at(table, shape, {body[0], body[1], body[2]}, turn);
  placed.parts.clear();
  if (shape.kind != ShapeKind::Compound) {
    placed.parts.push_back(placed.whole);
    return;
  }
  const Turn own = turn * own_turn(shape);
  for (std::int64_t k = shape.first; k < shape.first + shape.rows; ++k)
    placed.parts.push_back(solid_at(table, table.parts[k], placed.whole.centre, own));
}

}  // namespace smartmesh
