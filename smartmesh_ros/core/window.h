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
    const double u = column * resolution, v = row * resolution;
    return {pose.x + u * pose.cos - v * pose.sin, pose.y + u * pose.sin + v * pose.cos, at(row, column)};
  }
};

// Rectangle of cells: first row and column, and the row and column after the last.
struct CellRange {
  int top = 0, left = 0, bottom = 0, right = 0;
  bool empty() const { return bottom <= top || right <= left; }
};

// Fractional row and column of a point.
struct GridPoint {
  double row, column;
};

inline GridPoint to_grid(const GridPose& pose, double resolution, double x, double y) {
  const double dx = (x - pose.x) / resolution, dy = (y - pose.y) / resolution;
  return {dy * pose.cos - dx * pose.sin, dx * pose.cos + dy * pose.sin};
}

// Returns the cells of a grid of `rows` x `columns` samples that the horizontal extent of `bounds` meets.
CellRange cells_under(const GridPose& pose, double resolution, int rows, int columns, const Bounds& bounds);

// Reads the samples of some cells of a grid at `time` [s], with one more ring of samples around them, into `window`.
void read_window(const HeightGrid& grid, const CellRange& cells, double time, Window& window);

}  // namespace smartmesh
