// The soil under a shape, which has contacts of its own.
#pragma once

namespace smartmesh {

struct HeightGrid;

// Distance from the edge of the soil within which a point is on it [m].
constexpr double AT_EDGE_OF_SOIL = 1e-6;

// A map of soil, which other contacts bear: other ground ends at its edges. `map`: null = none. `is_below`: it is below
// the middle of a shape, for which its own edges are no ground; `is_all`: all below the shape is soil.
struct SoilBelow {
  const HeightGrid* map = nullptr;
  bool is_below = false, is_all = false;
};

}  // namespace smartmesh
