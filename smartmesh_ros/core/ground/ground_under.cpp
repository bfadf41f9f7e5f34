#include "ground/ground_under.h"

#include <algorithm>
#include <cmath>

#include "map/map_region.h"
#include "map/window.h"

namespace smartmesh {

namespace {

// Returns the samples around a box on a map in a pose, without rows or columns if the box is beside the map.
Region samples_around(const HeightGrid& grid, const GridPose& pose, const Bounds& box) {
  const GridExtent extent = extent_of(pose, grid.resolution, box);
  if (!extent.meets(grid)) return {};
  const auto whole = [](double value) { return static_cast<std::ptrdiff_t>(value); };
  return {whole(std::max(std::floor(extent.low.row), 0.0)), whole(std::max(std::floor(extent.low.column), 0.0)),
          whole(std::min(std::ceil(extent.high.row), grid.rows - 1.0)) + 1,
          whole(std::min(std::ceil(extent.high.column), grid.columns - 1.0)) + 1};
}

// Returns the variance of a sample's height [m^2], zero if it is exact, negative if the map is not corrected.
float variance_of(const HeightGrid& grid, std::size_t index) {
  if (grid.mode != Mode::Correct) return -1.0f;
  const float variance = grid.variances == nullptr ? 0.0f : grid.variances[index];
  return std::isfinite(variance) ? variance : 0.0f;
}

}  // namespace

void add_ground_under(const HeightGrid& grid, double time, const Bounds& box, GroundUnder& found) {
  const GridPose pose = grid.pose_at(time);
  const Region samples = samples_around(grid, pose, box);
  GridReader reader(grid, time, 0.0);
  for (std::ptrdiff_t r = samples.top; r < samples.bottom; ++r) {
    for (std::ptrdiff_t c = samples.left; c < samples.right; ++c) {
      const int row = static_cast<int>(r), column = static_cast<int>(c);
      const double height = reader.height(row, column);
      found.heights.push_back(std::isnan(height) ? HOLE : height);
      found.materials.push_back(grid.material_of(row, column));
      found.variances.push_back(variance_of(grid, grid.index(row, column)));
    }
  }
  found.slides |= samples.size() > 0 && pose.slides();
}

void add_blocks_under(const HeightGrid& grid, double time, const Bounds& box, std::vector<BlockUnder>& found) {
  const Region samples = samples_around(grid, grid.pose_at(time), box);
  if (samples.size() == 0) return;
  const Span down = blocks_of({samples.top, samples.bottom}), along = blocks_of({samples.left, samples.right});
  for (std::ptrdiff_t r = down.first; r < down.last; ++r)
    for (std::ptrdiff_t c = along.first; c < along.last; ++c)
      found.push_back({&grid, grid.clocks + r * grid.block_columns + c});
}

void Updates::add(const BlockUnder& block, double time) {
  const Clock& clock = *block.clock;
  const HeightGrid& grid = *block.grid;
  count += clock.updates;
  moves |= grid.track.interval > 0.0;
  if (grid.mode == Mode::Correct)
    settles |= remaining(clock, grid.shown, grid.settle) > 0.0;
  else
    moves |= may_move(clock, time, grid.mode);
}

bool differs(const GroundUnder& before, const GroundUnder& now, const Tolerance& tolerance) {
  if (before.slides || now.slides || before.heights.size() != now.heights.size()) return true;
  if (!(before.materials == now.materials) || before.vertices.size() != now.vertices.size()) return true;
  for (std::size_t k = 0; k < now.vertices.size(); ++k)
    if (std::abs(now.vertices[k] - before.vertices[k]) > tolerance.change) return true;
  for (std::size_t k = 0; k < now.heights.size(); ++k) {
    const double by_noise = tolerance.noise * std::sqrt(std::max(0.0f, now.variances[k]));
    const double limit = by_noise <= tolerance.most ? std::max(tolerance.change, by_noise) : tolerance.change;
    if (!(std::abs(now.heights[k] - before.heights[k]) <= limit)) return true;
  }
  return false;
}

}  // namespace smartmesh
