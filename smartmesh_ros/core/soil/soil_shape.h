// Undersides of the bodies that press the soil: boxes, spheres, cylinders and capsules.
//
// Flat faces go on beyond their edges by up to a cell of the grid, because the corners of all cells that a body touches
// must go down with it: between samples the ground is interpolated.
#pragma once

#include <utility>
#include <vector>

#include "shape/solid.h"

namespace smartmesh {

// A solid above a grid. All coordinates are relative to its middle, in axes of the grid: x along columns, y along rows.
struct Underside {
  Solid solid;
  ShapeKind kind;
  double half[3];    // half lengths of a box along its own axes; else radius, radius, half height [m]
  double spacing;    // of the samples [m]
  int upright;       // its axis whose face is on the ground
  bool is_level;     // a box, or a standing cylinder, whose sides are upright, or across the ground
  double margin[3];  // farthest distance along an axis of a corner of a cell that the shape's edge touches [m]
  double grown[3];   // half lengths with the margins of flat faces [m]
  Vec3 lowest;       // middle of the face that is on the ground, or of the line of a lying cylinder [m]
  Vec3 across[3];    // directions of the axes seen from above
  // What faces the ground, seen from above, along these from the middle [m]: the lowest face, and of the face beside it
  // the more, the more alike the two are inclined to the ground.
  double from[3], to[3];

  const Vec3& axis(int k) const { return solid.axes.row[k]; }
};

// `normal`: of the ground, upwards.
Underside underside(const Solid& solid, double spacing, const Vec3& normal = {0.0, 0.0, 1.0});

// Samples of a row of the grid at (x, y) [m] and what is above them. `low`: height of the underside [m], infinity
// beside it. `share`: of a sample's cell that what faces the ground covers. It is exact for rectangles along the grid.
// In other directions single shares are approximate, but their sum over the samples is near the area. Round undersides
// cover whole cells: their pressure vanishes at the edge.
struct UndersideRow {
  double y = 0.0;
  std::vector<double> x, low, share, high;  // `high` is work space
};

// Fills `low`; a row at once, because a processor divides two numbers in the time of one.
void look_up(const Underside& shape, UndersideRow& row);
// Fills `low` of the underside as it is, without the margins of flat faces, from that with them.
void look_up_exact(const Underside& shape, const UndersideRow& row, UndersideRow& exact);
// Fills `share`.
void cover(const Underside& shape, UndersideRow& row);

// Returns the unit normal, of either sign, of an underside with these half lengths at a point on it [m].
Vec3 normal_at(const Underside& shape, const double (&half)[3], const Vec3& point);

// Vertical component of a normal up to which a face is upright: soil beside a body does not carry it.
constexpr double STEEP = 0.05;

// Returns the smaller dimension b of the contact [m], for Bekker's Kc / b: of a box its narrower side, of a lying
// cylinder its height, of what is round seen from above the radius.
double contact_width(const Underside& shape);

// Returns half the length of the rectangle around all places with an underside [m].
double half_extent(const Underside& shape, int along);

// Returns true if a cylinder or capsule lies on its side, so that it rolls about its own axis 2.
bool lies(const Solid& solid);

// Returns how far from the middle, along columns and rows, a shape may be `below` a height above its middle [m].
std::pair<double, double> half_extents_below(const Underside& shape, double below);

}  // namespace smartmesh
