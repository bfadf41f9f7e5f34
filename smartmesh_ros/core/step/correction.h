// Bodies that move with corrections of the ground under them.
//
// For each body, one plane is fitted to the ground as shown before the correction and one to the correction itself. The
// body is rotated as the first plane tilts and moved vertically by the second plane, about the nearest point below it.
#pragma once

#include "ground/ground_under.h"
#include "shape/body_shape.h"

namespace smartmesh {

// Sums over the points under a body, relative to its position: weights, and products with x, y, the height before and
// the rise, each with the weight.
struct CorrectionSums {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  double height = 0.0, x_height = 0.0, y_height = 0.0, rise = 0.0, x_rise = 0.0, y_rise = 0.0;

  void add(double weight, double x_, double y_, double height_, double rise_);
};

// Adds the points under a body on a corrected grid. `before`, `after`: the grid as shown before and after the
// correction. Bodies that do not stand on the ground count little, and only near it.
void add_points_under(const HeightGrid& before, const HeightGrid& after, double time, const BodyShape& shape,
                      const BodyPose& body, bool stands, const Vec3& origin, CorrectionSums& sums);

// Moves a body with the ground under it; returns false if the ground did not change.
bool move_with(const CorrectionSums& sums, BodyPose& pose);

// Returns by how much fused or corrected samples under a body rose on average [m], whose `lowest` point moves with
// them, and adds their number to `count`.
double correction(const GroundUnder& before, const GroundUnder& now, double lowest, int& count);

}  // namespace smartmesh
