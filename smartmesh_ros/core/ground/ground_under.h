// The ground under a body at rest, and what changed of it since the body fell asleep.
#pragma once

#include <cstdint>
#include <vector>

#include "map/height_grid.h"

namespace smartmesh {

// Height of samples without ground, so that holes are equal [m].
constexpr double HOLE = 1e300;

// Ground inside the bounds of a body. `heights` [m] and `materials` of the samples of height maps, whose `variances`
// [m^2] are negative where a map is not fused, and the coordinates of the vertices of meshes [m]. `slides`: it moves
// horizontally.
struct GroundUnder {
  std::vector<double> heights, vertices;
  std::vector<Material> materials;
  std::vector<float> variances;
  bool slides = false;

  void clear() { heights.clear(), materials.clear(), vertices.clear(), variances.clear(), slides = false; }
};

// Adds the samples of a map at `time` [s] around a box.
void add_ground_under(const HeightGrid& grid, double time, const Bounds& box, GroundUnder& found);

// A block of samples of a map, which is under a body.
struct BlockUnder {
  const HeightGrid* grid;
  const Clock* clock;
};

// Adds the blocks of a map under a box at `time` [s].
void add_blocks_under(const HeightGrid& grid, double time, const Bounds& box, std::vector<BlockUnder>& found);

// Updates of the ground under a body so far. `moves`: it may move now. `settles`: it is a correction that is being
// blended in, by the instant shown rather than by the time.
struct Updates {
  std::int64_t count = 0;
  bool moves = false, settles = false;

  // Adds those of a block at `time` [s].
  void add(const BlockUnder& block, double time);
};

// Changes that a sleeping body does not mind: up to `change` [m] of any point and, on fused maps, what up to `noise`
// standard deviations of the estimate explain, unless that is more than `most` [m].
struct Tolerance {
  double change = 0.0, noise = 0.0, most = 0.0;
};

// Returns true if the ground differs from what it was `before` by more than a body minds.
bool differs(const GroundUnder& before, const GroundUnder& now, const Tolerance& tolerance);

}  // namespace smartmesh
