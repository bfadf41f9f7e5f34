// Windows of samples of the ground at an instant.
#pragma once

#include <vector>

#include "map/height_grid.h"

namespace smartmesh {

// Heights [m] of a rectangle of samples at one instant, row by row; NaN = no ground. `rises` [m]: of the samples within
// the time `ahead` [s], empty if none moves. `slides` [m/s]: their horizontal velocities, empty = they slide with
// `pose`.
struct Window {
  GridPose pose;  // of sample (0, 0) of the window
  double resolution = 1.0;
  int rows = 0, columns = 0;
  double ahead = 0.0;
  std::vector<double> heights, rises;
  std::vector<Vec3> slides;

  std::size_t index(int row, int column) const { return static_cast<std::size_t>(row) * columns + column; }
  double& at(int row, int column) { return heights[index(row, column)]; }
  double highest() const {
    double height = -1e300;
    for (double z : heights)
      if (z > height) height = z;
    return height;
  }
  double at(int row, int column) const { return heights[index(row, column)]; }
  bool moves() const { return !rises.empty(); }
  // Returns the velocity of a sample of ground that moves, mean over the time ahead [m/s].
  Vec3 velocity(int row, int column) const {
    const std::size_t k = index(row, column);
    Vec3 found;
    if (!slides.empty())
      found = slides[k];
    else if (pose.slides()) {
      const Vec3 p = point(row, column);
      found = pose.mean_slide(p.x, p.y, ahead);
    }
    found.z = rises[k] / ahead;
    return found;
  }
  Vec3 point(int row, int column) const {
    return pose.point({static_cast<double>(row), static_cast<double>(column)}, resolution, at(row, column));
  }
};

// Rectangle of cells or of samples: first row and column, and the row and column after the last.
struct CellRange {
  int top = 0, left = 0, bottom = 0, right = 0;
  bool empty() const { return bottom <= top || right <= left; }
};

// Range of places of a grid.
struct GridExtent {
  GridPoint low, high;

  // Returns true if some of it lies on a map.
  bool meets(const HeightGrid& grid) const {
    return high.row >= 0.0 && high.column >= 0.0 && low.row <= grid.rows - 1 && low.column <= grid.columns - 1;
  }
};

// Returns the rows and columns between which the horizontal extent of `bounds` lies.
GridExtent extent_of(const GridPose& pose, double resolution, const Bounds& bounds);

// Returns the cells of a grid at a pose that the horizontal extent of `bounds` meets.
CellRange cells_under(const HeightGrid& grid, const GridPose& pose, const Bounds& bounds);

// Reads the samples of some cells of a grid at `time` [s], when it has a pose, with one more ring of samples around
// them, into `window`. Velocities are means over the time `ahead` [s]; zero = they are not read.
void read_window(const HeightGrid& grid, const GridPose& pose, const CellRange& cells, double time, double ahead,
                 Window& window);

}  // namespace smartmesh
