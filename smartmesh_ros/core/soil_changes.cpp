#include "soil_changes.h"

#include <tuple>

namespace smartmesh {

namespace {

int blocks_of(int samples) { return (samples + (1 << BLOCK_SHIFT) - 1) >> BLOCK_SHIFT; }

// Returns the new height [m] and speed [m/s] of a sample that is at the height `now` [m], and notes them.
std::pair<float, float> change_of(SoilGround& ground, int row, int column, double now, const SoilUpdate& update) {
  if (!ground.knows(row, column)) return {ground.mapped(row, column), 0.0f};
  LayerSample& sample = ground.at(row, column);
  double left = std::min(sample.target - now, update.farthest);
  if (sample.pressed != update.number) left = std::max(left, -update.farthest);
  if (update.still < std::abs(left) && std::abs(left) <= update.carried) {
    sample.known = static_cast<float>(now);
    sample.moves = 1;
    return {sample.known, static_cast<float>(left / update.dt)};
  }
  if (std::abs(left) > update.still || sample.moves == 1) sample.known = static_cast<float>(now + left);
  sample.moves = 0;
  return {sample.known, 0.0f};
}

}  // namespace

ChangedBlocks::ChangedBlocks(int rows, int columns)
    : block_columns_(blocks_of(columns)), blocks_(static_cast<std::size_t>(blocks_of(rows)) * block_columns_) {}

SampleRectangle ChangedBlocks::note(SoilGround& ground, const SampleRectangle& rectangle, const SoilUpdate& update) {
  SampleRectangle changed;
  if (rectangle.empty()) return changed;
  for (int r = rectangle.top; r <= rectangle.bottom; ++r) {
    const double* now = nullptr;  // read where it is needed
    for (int c = rectangle.left; c <= rectangle.right; ++c) {
      if (!ground.knows(r, c)) continue;
      const LayerSample& sample = ground.at(r, c);
      if (sample.moves != 1) {
        if (now == nullptr) now = ground.now(r, rectangle.left, rectangle.right - rectangle.left + 1);
        if (!(std::abs(sample.target - now[c - rectangle.left]) > update.still)) continue;
      }
      const int number = (r >> BLOCK_SHIFT) * block_columns_ + (c >> BLOCK_SHIFT);
      if (blocks_[number].empty()) noted_.push_back(number);
      blocks_[number].add(r, c);
      changed.add(r, c);
    }
  }
  return changed;
}

SoilChanges ChangedBlocks::list(SoilGround& ground, const SoilUpdate& update) {
  SoilChanges changes;
  std::sort(noted_.begin(), noted_.end());
  for (const int number : noted_) {
    const SampleRectangle block = blocks_[number];
    blocks_[number] = {};
    changes.rectangles.push_back(block);
    const int columns = block.right - block.left + 1;
    for (int r = block.top; r <= block.bottom; ++r) {
      const std::size_t start = changes.heights.size();
      changes.heights.resize(start + columns), changes.velocities.resize(start + columns);
      const double* now = ground.now(r, block.left, columns);
      for (int k = 0; k < columns; ++k)
        std::tie(changes.heights[start + k], changes.velocities[start + k]) =
            change_of(ground, r, block.left + k, now[k], update);
    }
  }
  noted_.clear();
  return changes;
}

}  // namespace smartmesh
