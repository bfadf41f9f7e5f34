// A lattice of samples that measures changes from map to map; terrain/noise_check.py explains it.
#pragma once

#include <cstdint>

namespace smartmesh {

// Samples of the map at a lattice point: the sample itself between its two neighbours in the row.
constexpr int STENCIL = 3;

// State of the points, in arrays of Python's: `cells` (high, wide, 2), `heights` (high, wide, STENCIL) [m], `steps`
// (high, wide) [m]. `down`, `along`: distances between the points [samples of the map].
struct Lattice {
  std::int64_t* cells;
  double* heights;
  double* steps;
  std::int64_t high, wide, down, along;
};

// A map: heights (rows, columns) [m] above `z` [m], and the position of sample (0, 0) in the world [samples].
struct PlacedMap {
  const float* heights;
  std::int64_t rows, columns;
  double z;
  std::int64_t first_row, first_column;

  // Returns the height of a sample [m], NaN beyond the edge.
  double at(std::int64_t row, std::int64_t column) const;
};

// Numbers of lattice points as in terrain/noise_check.py, and the `median` of the changes [m].
struct LatticeCounts {
  std::int64_t known = 0, changed = 0, reversed = 0, tilted = 0, agreeing = 0;
  double tilt = 0.0, median = 0.0;
};

// Compares a map to the one before, and stores it in the lattice. Changes below `least` [m] are ignored.
LatticeCounts compare(const Lattice& lattice, const PlacedMap& map, double least);

// Returns true if the samples of a map differ by a constant from those with the same indices in the map before. Then
// the ground moved together with the map. `least` [m]: tolerance.
bool moved_as_one(const Lattice& lattice, const PlacedMap& map, double least);

}  // namespace smartmesh
