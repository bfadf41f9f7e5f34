// What bodies pressed into the heights of a map, over those that its sender knows.
#pragma once

#include <vector>

#include "map_region.h"

namespace smartmesh {

struct HeightGrid;

// Prints stay while the sender sends the heights again that were there before, and are forgotten where it sends others.
class Prints {
 public:
  // Rectangle around all prints so far.
  const Region& around() const { return around_; }
  // What the sender sent for pressed samples (rows, columns) [m], NaN for others; empty: nothing was pressed.
  const std::vector<float>& given() const { return given_; }
  void restore(std::vector<float> given, const Region& around) { given_ = std::move(given), around_ = around; }

  // Writes the height of a pressed sample [m].
  void press(HeightGrid& map, int row, int column, float height);
  // Takes the prints out of a map for an update. The map must then have them `put_back`.
  void lift(HeightGrid& map);
  void put_back(HeightGrid& map);

 private:
  std::vector<float> given_, lifted_;
  Region around_;
};

}  // namespace smartmesh
