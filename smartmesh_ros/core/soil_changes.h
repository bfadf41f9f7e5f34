// The changes of a height map that an update of its soil makes, by blocks of samples.
#pragma once

#include <vector>

#include "soil_foot.h"

namespace smartmesh {

// Changed rectangles of a map, at most one in each block of samples. `heights` [m] without the map's z, and
// `velocities` [m/s], of one rectangle after the other, each row by row.
struct SoilChanges {
  std::vector<SampleRectangle> rectangles;
  std::vector<float> heights, velocities;
};

// Finds the changes of the samples around the feet, and keeps no memory of the blocks between updates but its space.
class ChangedBlocks {
 public:
  explicit ChangedBlocks(int rows = 0, int columns = 0);

  // Notes the samples of a rectangle whose height changes, or which have to stop; returns the rectangle around them.
  SampleRectangle note(SoilGround& ground, const SampleRectangle& rectangle, const SoilUpdate& update);

  // Returns the changes of all noted blocks, in the order of the blocks, and forgets them: each sample starts where it
  // is and reaches its target at the end of the update.
  SoilChanges list(SoilGround& ground, const SoilUpdate& update);

 private:
  int block_columns_;
  std::vector<SampleRectangle> blocks_;
  std::vector<int> noted_;  // blocks that change
};

}  // namespace smartmesh
