#include "soil/placed_part.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Farthest place [m] at which a body counts; beyond it was thrown to infinity.
constexpr double FARTHEST = 1e9;

}  // namespace

Vec3 PlacedPart::normal(const Vec3& offset, bool is_beside) const {
  if (is_beside && offset.z <= lowest) return {0.0, 0.0, 1.0};
  Vec3 found = normal_at(shape, shape.half, offset);
  if (is_beside || std::abs(found.z) < STEEP) {  // a sample on the edge of an upright face does not press with that
    const bool is_flat = shape.kind == ShapeKind::Box || shape.upright == 2;
    found = is_flat ? shape.axis(shape.upright) : normal_at(shape, shape.grown, offset);
  }
  return found.z < 0.0 ? -found : found;
}

PlacedPart place_above(const SoilLattice& soil, const Solid& of, double time) {
  const GridPose pose = soil.map().pose_at(time);
  Solid solid = of;
  for (Vec3& axis : solid.axes.row)
    axis = {pose.cos * axis.x + pose.sin * axis.y, pose.cos * axis.y - pose.sin * axis.x, axis.z};
  const GridPoint at = to_grid(pose, soil.spacing(), solid.centre.x, solid.centre.y);
  const Vec3 reach = solid.half_extents();
  return {pose,
          underside(solid, soil.spacing(), soil.normal_around(at, reach.x, reach.y)),
          at.column,
          at.row,
          solid.centre.z - soil.map().z,
          -reach.z};
}

CellRange samples_around(const SoilLattice& soil, const PlacedPart& placed, double x, double y) {
  const double wide = x / soil.spacing(), high = y / soil.spacing();
  if (!(std::abs(placed.column) + std::abs(placed.row) + std::abs(placed.z) + wide + high < FARTHEST)) return {};
  return {std::max(0, static_cast<int>(placed.row - high)), std::max(0, static_cast<int>(placed.column - wide)),
          std::min(soil.rows(), static_cast<int>(std::floor(placed.row + high)) + 2),
          std::min(soil.columns(), static_cast<int>(std::floor(placed.column + wide)) + 2)};
}

}  // namespace smartmesh
