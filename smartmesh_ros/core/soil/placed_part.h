// A part of a body above the samples of the soil, in axes of their grid.
#pragma once

#include "soil/soil_lattice.h"
#include "soil/soil_shape.h"

namespace smartmesh {

// `shape`: its underside with flat faces that go on beyond their edges. `column`, `row`: fractional
// fine sample of its middle, at the height `z` without the map's. `lowest` [m]: of its points, from there.
struct PlacedPart {
  GridPose pose;
  Underside shape;
  double column, row, z, lowest;

  Vec3 to_world(const Vec3& v) const { return {pose.cos * v.x - pose.sin * v.y, pose.sin * v.x + pose.cos * v.y, v.z}; }
  // Returns a vector in axes of the grid.
  Vec3 to_grid(const Vec3& v) const { return {pose.cos * v.x + pose.sin * v.y, pose.cos * v.y - pose.sin * v.x, v.z}; }
  // Returns the normal of the underside that has the given heights: otherwise forces would do work that is not theirs.
  Vec3 normal(const Vec3& offset, bool is_beside) const;
};

PlacedPart place_above(const SoilLattice& soil, const Solid& solid, double time);

// Returns the samples within a distance of a part's middle along columns `x` and rows `y` [m]; none for a body that was
// thrown to infinity.
CellRange samples_around(const SoilLattice& soil, const PlacedPart& placed, double x, double y);

}  // namespace smartmesh
