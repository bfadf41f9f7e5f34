// A lattice of samples that measures changes from map to map, for terrain/noise_check.py.
#pragma once

#include <cstdint>
#include <vector>

#include "math/vec3.h"

namespace smartmesh {

// A map: heights (rows, columns) [m] above `z` [m], and the position of sample (0, 0) in the world [samples].
struct PlacedMap {
  const float* heights;
  std::int64_t rows, columns;
  double z;
  std::int64_t first_row, first_column;

  // Returns the height of a sample [m], NaN beyond the edge.
  double at(std::int64_t row, std::int64_t column) const;
};

// Numbers of lattice points that are known in a map and the one before; that changed now and before; of these, with
// opposite signs; that are tilted, with changes that differ from those of both neighbours; of these, with differences
// of the same sign. `tilt` [m]: sum of the differences to one neighbour. `median` [m]: of the changes.
struct LatticeCounts {
  std::int64_t known = 0, changed = 0, reversed = 0, tilted = 0, agreeing = 0;
  double tilt = 0.0, median = 0.0;
};

// About a hundred points, at the same cost for any map size. They keep their positions in the world while a map scrolls
// by whole cells, and move with a map that slides.
class SampleLattice {
 public:
  // For maps of some rows and columns, with about so many points along each side.
  SampleLattice(std::int64_t rows, std::int64_t columns, std::int64_t points);

  // Compares a map to the one before, and stores it. Changes below `least` [m] are ignored.
  LatticeCounts compare(const PlacedMap& map, double least);
  // Returns true if the samples of a map differ by a constant from those with the same indices in the map before. Then
  // the ground moved together with the map. `least` [m]: tolerance.
  bool moved_as_one(const PlacedMap& map, double least) const;
  // Forgets the maps before.
  void forget();

 private:
  // Row and column in the lattice of the world, last heights of the sample there and of its neighbours in the row [m],
  // NaN = unknown, and the last change [m], zero = none yet.
  struct Point {
    std::int64_t i = 0, j = 0;
    double left = NONE, own = NONE, right = NONE, step = 0.0;
  };

  std::int64_t down_, along_;  // distances between points [samples of the map]
  std::int64_t high_, wide_;
  std::vector<Point> points_;  // a ring buffer (high, wide)
};

}  // namespace smartmesh
