// Soil of a height map: one update of it under the bodies that press it.
#pragma once

#include "soil_changes.h"
#include "soil_pressing.h"

namespace smartmesh {

class Soil {
 public:
  explicit Soil(const SoilLayer& layer = {}) : layer_(layer), blocks_(layer.rows, layer.columns) {}

  int rows() const { return layer_.rows; }
  int columns() const { return layer_.columns; }

  // Presses `count` feet into the soil at `time` [s], lets it flow, and returns the changes of the map.
  SoilChanges update(const HeightGrid& grid, double time, const SoilUpdate& update, Foot* feet, std::size_t count);

 private:
  SoilLayer layer_;
  ChangedBlocks blocks_;
  PressingScratch scratch_;
};

}  // namespace smartmesh
