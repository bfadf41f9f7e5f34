#include "ground_under.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "window.h"

namespace smartmesh {

Region samples_around(const HeightGrid& grid, const GridPose& pose, const double* box) {
  const double inf = std::numeric_limits<double>::infinity(), last_row = grid.rows - 1.0, last_column = grid.columns - 1.0;
  double low_row = inf, high_row = -inf, low_column = inf, high_column = -inf;
  for (int corner = 0; corner < 4; ++corner) {
    const GridPoint p = to_grid(pose, grid.resolution, box[corner & 1 ? 3 : 0], box[corner & 2 ? 4 : 1]);
    low_row = std::min(low_row, p.row), high_row = std::max(high_row, p.row);
    low_column = std::min(low_column, p.column), high_column = std::max(high_column, p.column);
  }
  if (low_row > last_row || low_column > last_column || high_row < 0.0 || high_column < 0.0) return {};
  const auto whole = [](double value) { return static_cast<std::ptrdiff_t>(value); };
  return {whole(std::max(std::floor(low_row), 0.0)), whole(std::max(std::floor(low_column), 0.0)),
          whole(std::min(std::ceil(high_row), last_row)) + 1, whole(std::min(std::ceil(high_column), last_column)) + 1};
}

bool slides(const GridPose& pose) { return pose.slide_x != 0.0 || pose.slide_y != 0.0 || pose.spin != 0.0; }

std::int64_t updates_under(const HeightGrid& grid, const GridPose& pose, const double* box, double time) {
  const Region samples = samples_around(grid, pose, box);
  if (samples.size() == 0) return 0;
  const Span down = blocks_of({samples.top, samples.bottom}), along = blocks_of({samples.left, samples.right});
  std::int64_t count = 0;
  for (std::ptrdiff_t r = down.first; r < down.last; ++r) {
    for (std::ptrdiff_t c = along.first; c < along.last; ++c) {
      const Clock& clock = grid.clocks[r * grid.block_columns + c];
      const bool moves = grid.mode == Mode::Correct
                             ? remaining(clock, grid.shown, grid.settle) > 0.0
                             : slides(pose) || (clock.known > 0 && goes_on(time, clock.time, clock.lifetime, clock.delay));
      if (moves) return -1;
      count += clock.updates;
    }
  }
  return count;
}

void write_positions(const HeightGrid& grid, const GridPose& pose, const Region& samples, double* positions) {
  for (std::ptrdiff_t r = samples.top; r < samples.bottom; ++r) {
    for (std::ptrdiff_t c = samples.left; c < samples.right; ++c) {
      const double u = static_cast<double>(c) * grid.resolution, v = static_cast<double>(r) * grid.resolution;
      *positions++ = pose.x + u * pose.cos - v * pose.sin;
      *positions++ = pose.y + u * pose.sin + v * pose.cos;
    }
  }
}

}  // namespace smartmesh
