#include "ground_under.h"

#include <algorithm>
#include <cmath>

#include "window.h"

namespace smartmesh {

Region samples_around(const HeightGrid& grid, const GridPose& pose, const Bounds& box) {
  const GridExtent extent = extent_of(pose, grid.resolution, box);
  if (!extent.meets(grid)) return {};
  const auto whole = [](double value) { return static_cast<std::ptrdiff_t>(value); };
  return {whole(std::max(std::floor(extent.low.row), 0.0)), whole(std::max(std::floor(extent.low.column), 0.0)),
          whole(std::min(std::ceil(extent.high.row), grid.rows - 1.0)) + 1,
          whole(std::min(std::ceil(extent.high.column), grid.columns - 1.0)) + 1};
}

std::int64_t updates_under(const HeightGrid& grid, const GridPose& pose, const Bounds& box, double time) {
  const Region samples = samples_around(grid, pose, box);
  if (samples.size() == 0) return 0;
  const Span down = blocks_of({samples.top, samples.bottom}), along = blocks_of({samples.left, samples.right});
  std::int64_t count = 0;
  for (std::ptrdiff_t r = down.first; r < down.last; ++r) {
    for (std::ptrdiff_t c = along.first; c < along.last; ++c) {
      const Clock& clock = grid.clocks[r * grid.block_columns + c];
      const bool moves = grid.mode == Mode::Correct
                             ? remaining(clock, grid.shown, grid.settle) > 0.0
                             : pose.slides() || may_move(clock, time, grid.mode);
      if (moves) return -1;
      count += clock.updates;
    }
  }
  return count;
}

void write_positions(const HeightGrid& grid, const GridPose& pose, const Region& samples, double* positions) {
  for (std::ptrdiff_t r = samples.top; r < samples.bottom; ++r) {
    for (std::ptrdiff_t c = samples.left; c < samples.right; ++c) {
      const Vec3 at = pose.point({static_cast<double>(r), static_cast<double>(c)}, grid.resolution);
      *positions++ = at.x, *positions++ = at.y;
    }
  }
}

}  // namespace smartmesh
