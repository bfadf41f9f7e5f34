#include "window.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Returns `value` rounded down, limited to the range from `low` to `high`.
int floor_within(double value, int low, int high) {
  return static_cast<int>(std::floor(std::clamp(value, static_cast<double>(low), static_cast<double>(high))));
}

}  // namespace

CellRange cells_under(const GridPose& pose, double resolution, int rows, int columns, const Bounds& bounds) {
  double low_row = 1e300, high_row = -1e300, low_column = 1e300, high_column = -1e300;
  for (int corner = 0; corner < 4; ++corner) {
    const GridPoint p = to_grid(pose, resolution, corner & 1 ? bounds.high.x : bounds.low.x,
                                corner & 2 ? bounds.high.y : bounds.low.y);
    low_row = std::min(low_row, p.row);
    high_row = std::max(high_row, p.row);
    low_column = std::min(low_column, p.column);
    high_column = std::max(high_column, p.column);
  }
  if (!(high_row >= 0.0 && high_column >= 0.0 && low_row <= rows - 1 && low_column <= columns - 1)) return {};
  return {floor_within(low_row, 0, rows - 2), floor_within(low_column, 0, columns - 2),
          floor_within(high_row, 0, rows - 2) + 1, floor_within(high_column, 0, columns - 2) + 1};
}

void read_window(const HeightGrid& grid, const CellRange& cells, double time, Window& window) {
  const int top = cells.top - 1, left = cells.left - 1;
  window.rows = cells.bottom - cells.top + 3;
  window.columns = cells.right - cells.left + 3;
  window.resolution = grid.resolution;
  window.pose = grid.pose_at(time);
  const double u = left * grid.resolution, v = top * grid.resolution;
  window.pose.x += u * window.pose.cos - v * window.pose.sin;
  window.pose.y += u * window.pose.sin + v * window.pose.cos;
  window.heights.resize(static_cast<std::size_t>(window.rows) * window.columns);
  GridReader reader(grid, time, 0.0);
  for (int r = 0; r < window.rows; ++r) reader.read_row(top + r, left, window.columns, &window.at(r, 0));
}

}  // namespace smartmesh
