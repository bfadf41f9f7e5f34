// The facet of a height map at a point.
#pragma once

#include <algorithm>

#include "map/height_grid.h"
#include "map/window.h"

namespace smartmesh {

// Distance outside a map at which a point still counts as on its edge [samples].
constexpr double EDGE = 1e-6;

// Ground of a facet at a point: height [m], NaN = none, and mean vertical velocity [m/s] over a duration. `per_column`,
// `per_row` [m]: change of the height from sample to sample.
struct GridFacet {
  double height = NONE, velocity = 0.0, per_column = 0.0, per_row = 0.0;
};

// Returns the facet at the place (`v` along rows, `u` along columns) of a cell with the corners `near` and `far` on its
// diagonal, which leads from sample (0, 0) to (1, 1), and `corner` below it, or above it. `ahead` [s]: time of the
// rises.
GridFacet facet_of(const Sample& near, const Sample& corner, const Sample& far, double v, double u, bool above,
                   double ahead);

// Returns the facet at a place inside a map. A place on an edge belongs to each facet there, so it has ground if one of
// these facets is whole.
GridFacet facet_at(const HeightGrid& grid, GridReader& reader, GridPoint place, double ahead);

inline bool is_on(const HeightGrid& grid, const GridPoint& p) {
  return p.row >= -EDGE && p.column >= -EDGE && p.row <= grid.rows - 1 + EDGE && p.column <= grid.columns - 1 + EDGE;
}

// Distance from the edge of a map within which a point is on it [m].
constexpr double AT_EDGE = 1e-6;

// Returns true if all cells of a map at a pose within a `radius` [m] of a point have ground, horizontally.
bool is_ground_around(const HeightGrid& grid, const GridPose& pose, const Vec3& p, double radius);

// Returns the index of the sample nearest to a place inside a map.
inline std::size_t nearest_index(const HeightGrid& grid, const GridPoint& p) {
  return grid.index(static_cast<int>(std::lround(p.row)), static_cast<int>(std::lround(p.column)));
}

// Returns the place of a map nearest to `p`.
inline GridPoint clamped(const HeightGrid& grid, const GridPoint& p) {
  return {std::clamp(p.row, 0.0, grid.rows - 1.0), std::clamp(p.column, 0.0, grid.columns - 1.0)};
}

}  // namespace smartmesh
