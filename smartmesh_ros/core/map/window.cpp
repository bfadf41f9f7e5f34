#include "map/window.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Returns `value` rounded down, limited to the range from `low` to `high`.
int floor_within(double value, int low, int high) {
  return static_cast<int>(std::floor(std::clamp(value, static_cast<double>(low), static_cast<double>(high))));
}

}  // namespace

GridExtent extent_of(const GridPose& pose, double resolution, const Bounds& bounds) {
  const Vec3 &low = bounds.low, &high = bounds.high;
  const auto [least, most] = Mat3{{{-pose.sin, pose.cos}, {pose.cos, pose.sin}}} *
                             Bounds{{(low.x - pose.x) / resolution, (low.y - pose.y) / resolution},
                                    {(high.x - pose.x) / resolution, (high.y - pose.y) / resolution}};
  return {{least.x, least.y}, {most.x, most.y}};
}

CellRange cells_under(const HeightGrid& grid, const GridPose& pose, const Bounds& bounds) {
  const GridExtent extent = extent_of(pose, grid.resolution, bounds);
  if (!extent.meets(grid)) return {};
  const int last_row = grid.rows - 2, last_column = grid.columns - 2;
  return {floor_within(extent.low.row, 0, last_row), floor_within(extent.low.column, 0, last_column),
          floor_within(extent.high.row, 0, last_row) + 1, floor_within(extent.high.column, 0, last_column) + 1};
}

void read_window(const HeightGrid& grid, const GridPose& pose, const CellRange& cells, double time, double ahead,
                 Window& window) {
  const int top = cells.top - 1, left = cells.left - 1;
  window.rows = cells.bottom - cells.top + 3;
  window.columns = cells.right - cells.left + 3;
  window.resolution = grid.resolution;
  window.pose = pose.from({static_cast<double>(top), static_cast<double>(left)}, grid.resolution);
  const std::size_t count = static_cast<std::size_t>(window.rows) * window.columns;
  window.heights.resize(count);
  window.ahead = ahead;
  window.slides.clear();
  std::vector<double>& rises = window.rises;
  rises.resize(ahead > 0.0 ? count : 0);
  GridReader reader(grid, time, ahead);
  for (int r = 0; r < window.rows; ++r)
    reader.read_row(top + r, left, window.columns, &window.at(r, 0),
                    ahead > 0.0 ? &rises[window.index(r, 0)] : nullptr);
  const bool moves =
      window.pose.slides() || std::any_of(rises.begin(), rises.end(), [](double rise) { return rise != 0.0; });
  if (!moves) rises.clear();
}

}  // namespace smartmesh
