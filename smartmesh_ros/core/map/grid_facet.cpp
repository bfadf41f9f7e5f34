#include "map/grid_facet.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Distance from an edge of a facet at which a place counts as on that edge [cells].
constexpr double ON_EDGE = 1e-9;

GridFacet facet_in(GridReader& reader, int row, int column, double v, double u, bool above, double ahead) {
  return facet_of(reader.read(row, column), above ? reader.read(row + 1, column) : reader.read(row, column + 1),
                  reader.read(row + 1, column + 1), v, u, above, ahead);
}

}  // namespace

GridFacet facet_of(const Sample& near, const Sample& corner, const Sample& far, double v, double u, bool above,
                   double ahead) {
  if (std::isnan(near.height + corner.height + far.height)) return {};
  const double of_near = 1.0 - (above ? v : u), of_corner = above ? v - u : u - v, of_far = above ? u : v;
  const double first = corner.height - near.height, second = far.height - corner.height;
  return {of_near * near.height + of_corner * corner.height + of_far * far.height,
          (of_near * near.rise + of_corner * corner.rise + of_far * far.rise) / ahead, above ? second : first,
          above ? first : second};
}

bool is_ground_around(const HeightGrid& grid, const GridPose& pose, const Vec3& p, double radius) {
  const Bounds bounds = Bounds{p, p}.grown(radius);
  const auto [low, high] = extent_of(pose, grid.resolution, bounds);
  if (!is_on(grid, low) || !is_on(grid, high)) return false;
  const CellRange cells = cells_under(grid, pose, bounds);
  for (int r = cells.top; r <= cells.bottom; ++r)
    for (int c = cells.left; c <= cells.right; ++c)
      if (std::isnan(grid.heights[grid.index(r, c)])) return false;
  return true;
}

GridFacet facet_at(const HeightGrid& grid, GridReader& reader, GridPoint place, double ahead) {
  const int r = std::min(static_cast<int>(place.row), grid.rows - 2);
  const int c = std::min(static_cast<int>(place.column), grid.columns - 2);
  const double v = place.row - r, u = place.column - c;
  GridFacet found = facet_in(reader, r, c, v, u, u < v, ahead);
  if (!std::isnan(found.height)) return found;
  for (int a = v <= ON_EDGE ? r - 1 : r; a <= (v >= 1.0 - ON_EDGE ? r + 1 : r); ++a) {
    for (int b = u <= ON_EDGE ? c - 1 : c; b <= (u >= 1.0 - ON_EDGE ? c + 1 : c); ++b) {
      const double up = place.row - a, right = place.column - b;
      for (bool above : {false, true}) {
        if ((above ? right - up : up - right) > ON_EDGE) continue;  // beyond the diagonal
        found = facet_in(reader, a, b, up, right, above, ahead);
        if (!std::isnan(found.height)) return found;
      }
    }
  }
  return {};
}

}  // namespace smartmesh
