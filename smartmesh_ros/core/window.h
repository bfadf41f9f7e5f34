// Windows of samples of the ground at an instant.
#pragma once

#include <vector>

#include "height_grid.h"

namespace smartmesh {

// Heights [m] of a rectangle of samples at one instant, row by row; NaN = no ground.
struct Window {
  GridPose pose;  // of sample (0, 0) of the window
  double resolution = 1.0;
  int rows = 0, columns = 0;
  std::vector<double> heights;

  double& at(int row, int column) { return heights[static_cast<std::size_t>(row) * columns + column]; }
  double highest() const {
    double height = -1e300;
    for (double z : heights)
      if (z > height) height = z;
    return height;
  }
  double at(int row, int column) const { return heights[static_cast<std::size_t>(row) * columns + column]; }
  Vec3 point(int row, int column) const {
    return pose.point({static_cast<double>(row), static_cast<double>(column)}, resolution, at(row, column));
  }
};

// Rectangle of cells: first row and column, and the row and column after the last.
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

// Returns the cells of a grid at `time` [s] that the horizontal extent of `bounds` meets.
CellRange cells_under(const HeightGrid& grid, double time, const Bounds& bounds);

// Reads the samples of some cells of a grid at `time` [s], with one more ring of samples around them, into `window`.
void read_window(const HeightGrid& grid, const CellRange& cells, double time, Window& window);

}  // namespace smartmesh
