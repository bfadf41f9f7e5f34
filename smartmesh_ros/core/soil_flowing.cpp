#include "soil_flowing.h"

namespace smartmesh {

namespace {

// Adds loose soil to a sample without load, or takes it away [m].
void raise_level(SoilGround& ground, int row, int column, double by) {
  LayerSample& sample = ground.at(row, column);
  sample.level += by;
  sample.target = sample.level - sample.plastic;
}

// Returns true if displaced soil may move onto a sample, which then is in the layer.
bool takes_soil(SoilGround& ground, int row, int column, std::int32_t number, bool pristine) {
  const LayerSample& sample = ground.at(row, column);
  if (std::isnan(ground.mapped(row, column)) || sample.pressed == number) return false;
  ground.note(row, column);
  return !pristine || sample.plastic == 0.0f;
}

// Moves soil from the higher of two samples to the lower one until they differ by `update.drop`.
void even_out(SoilGround& ground, int row, int column, int other_row, int other_column, const SoilUpdate& update) {
  LayerSample &one = ground.at(row, column), &other = ground.at(other_row, other_column);
  if (one.touched == 0 && other.touched == 0) return;
  if (one.pressed == update.number || other.pressed == update.number) return;
  if (std::isnan(ground.mapped(row, column)) || std::isnan(ground.mapped(other_row, other_column))) return;
  ground.note(row, column);
  ground.note(other_row, other_column);
  const double difference = one.target - other.target, excess = std::abs(difference) - update.drop;
  if (!(excess > 0.0)) return;
  const double by = difference > 0.0 ? 0.5 * excess : -0.5 * excess;
  raise_level(ground, row, column, -by);
  raise_level(ground, other_row, other_column, by);
}

}  // namespace

void recover(SoilGround& ground, const SampleRectangle& seen, std::int32_t number) {
  for (int r = seen.top; r <= seen.bottom; ++r) {
    for (int c = seen.left; c <= seen.right; ++c) {
      LayerSample& sample = ground.at(r, c);
      if (sample.touched != 1 || sample.pressed == number || !(sample.pressure > 0.0f)) continue;
      sample.pressure = sample.shear_x = sample.shear_y = 0.0f;
      sample.target = sample.level - sample.plastic;
    }
  }
}

void move_to_rim(SoilGround& ground, const Foot& foot, const SoilUpdate& update) {
  const SampleRectangle rim = foot.pressed.grown(update.rim, ground.rows, ground.columns);
  for (const bool pristine : {true, false}) {
    int count = 0;
    for (int r = rim.top; r <= rim.bottom; ++r)
      for (int c = rim.left; c <= rim.right; ++c) count += takes_soil(ground, r, c, update.number, pristine);
    if (count == 0) continue;
    const double by = update.flow * foot.displaced / (count * ground.spacing * ground.spacing);
    for (int r = rim.top; r <= rim.bottom; ++r)
      for (int c = rim.left; c <= rim.right; ++c)
        if (takes_soil(ground, r, c, update.number, pristine)) raise_level(ground, r, c, by);
    return;
  }
}

void slide_down(SoilGround& ground, const SampleRectangle& rectangle, const SoilUpdate& update) {
  for (int round = 0; round < update.slides; ++round) {
    for (int r = rectangle.top; r <= rectangle.bottom; ++r) {
      for (int c = rectangle.left; c <= rectangle.right; ++c) {
        if (c < rectangle.right) even_out(ground, r, c, r, c + 1, update);
        if (r < rectangle.bottom) even_out(ground, r, c, r + 1, c, update);
      }
    }
  }
}

}  // namespace smartmesh
