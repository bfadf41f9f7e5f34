// The memory of a height map.
#pragma once

#include <vector>

#include "map/map_region.h"
#include "map/untouched.h"

namespace smartmesh {

// A height map and its arrays, as HeightGrid explains them. `fused`, `variances`: of the estimate of corrected heights
// (rows, columns) [m], NaN = not measured yet, and [m^2]; empty: heights are not fused.
struct MapMemory {
  HeightGrid grid;
  std::vector<float> heights;
  Untouched<float> velocities, offsets, rates;
  std::vector<Clock> clocks;
  std::vector<float> fused, variances;

  MapMemory(int rows, int columns) : MapMemory(rows, columns, static_cast<std::size_t>(rows) * columns) {}
  MapMemory(const MapMemory&) = delete;

  // Begins to fuse heights, of which nothing is known yet.
  void begin_fusion() {
    fused.assign(heights.size(), std::numeric_limits<float>::quiet_NaN()), variances.assign(heights.size(), 0.0f);
    grid.variances = variances.data();
  }

 private:
  MapMemory(int rows, int columns, std::size_t size)
      : heights(size),
        velocities(KEPT * size),
        offsets(size),
        rates(size),
        clocks(static_cast<std::size_t>(blocks_of({0, rows}).last * blocks_of({0, columns}).last), Clock{}) {
    grid.heights = heights.data(), grid.velocities = velocities.data();
    grid.offsets = offsets.data(), grid.rates = rates.data(), grid.clocks = clocks.data();
    grid.rows = rows, grid.columns = columns, grid.block_columns = static_cast<int>(blocks_of({0, columns}).last);
    for (Clock& clock : clocks) clock.time = -INFINITE;
  }
};

}  // namespace smartmesh
