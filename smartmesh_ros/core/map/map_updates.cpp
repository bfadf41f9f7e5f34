#include "map/map_updates.h"

#include <optional>
#include <vector>

#include "map/blending.h"

namespace smartmesh {

namespace {

// How the velocities of one block are written, and to which `slot` of the ring buffer.
struct BlockUpdate {
  Span columns;
  std::ptrdiff_t slot;
  Estimate estimate;
  float inverse, keep;
};

// Notes the update in the clocks of one row of blocks.
void note_blocks(HeightGrid& map, const Region& place, const NewSamples& samples, const Intervals& intervals,
                 std::ptrdiff_t block_row, std::vector<BlockUpdate>& blocks) {
  blocks.clear();
  const Span rows = block_span(block_row, map.rows), touched = blocks_of({place.left, place.right});
  for (std::ptrdiff_t k = touched.first; k < touched.last; ++k) {
    const Span columns = block_span(k, map.columns);
    const bool whole = place.top <= rows.first && place.bottom >= rows.last && place.left <= columns.first &&
                       place.right >= columns.last;
    Clock& clock = map.clocks[block_row * map.block_columns + k];
    const VelocityUpdate update = note_update(clock, samples.time, samples.velocities != nullptr, whole, intervals);
    blocks.push_back({columns, static_cast<std::ptrdiff_t>(clock.newest), update.estimate,
                      static_cast<float>(update.inverse), static_cast<float>(update.keep)});
  }
}

// Writes the velocities of samples that got no new heights, and were at rest for the interval.
void rest(float* velocities, const Span& samples, const BlockUpdate& block) {
  if (block.estimate == Estimate::Difference || (block.estimate == Estimate::Given && block.keep == 0.0f)) {
    for (std::ptrdiff_t c = samples.first; c < samples.last; ++c) velocities[c] = 0.0f;  // also ends NaN
  } else if (block.keep != 1.0f) {
    for (std::ptrdiff_t c = samples.first; c < samples.last; ++c) velocities[c] *= block.keep;
  }
}

// Writes `count` new heights and their velocities.
void write(float* velocities, float* heights, const float* fresh, const float* given, std::ptrdiff_t count,
           const BlockUpdate& block) {
  const float inverse = block.inverse, keep = block.keep;
  switch (block.estimate) {
    case Estimate::Unchanged:
      break;
    case Estimate::Difference:
      for (std::ptrdiff_t c = 0; c < count; ++c) velocities[c] = (fresh[c] - heights[c]) * inverse;
      break;
    case Estimate::Merged:
      for (std::ptrdiff_t c = 0; c < count; ++c)
        velocities[c] = velocities[c] * keep + (fresh[c] - heights[c]) * inverse;
      break;
    case Estimate::Given:
      for (std::ptrdiff_t c = 0; c < count; ++c) velocities[c] = given[c];
      break;
  }
  for (std::ptrdiff_t c = 0; c < count; ++c) heights[c] = fresh[c];
}

// Writes the part of a row that is in one block.
void take_part(HeightGrid& map, const Region& place, const NewSamples& samples, std::ptrdiff_t row,
               const BlockUpdate& block) {
  float* velocities = map.velocities + (block.slot * map.rows + row) * map.columns;
  if (!place.has_row(row)) return rest(velocities, block.columns, block);
  const Span inside = block.columns.within(place.left, place.right);
  rest(velocities, {block.columns.first, inside.first}, block);
  rest(velocities, {inside.last, block.columns.last}, block);
  const std::ptrdiff_t from = (row - place.top) * place.width() + inside.first - place.left;
  write(velocities + inside.first, map.heights + row * map.columns + inside.first, samples.heights + from,
        samples.velocities == nullptr ? nullptr : samples.velocities + from, inside.last - inside.first, block);
}

}  // namespace

void take_heights(HeightGrid& map, const Region& place, const NewSamples& samples, const Intervals& intervals) {
  std::vector<BlockUpdate> blocks;
  const Span touched = blocks_of({place.top, place.bottom}), along = blocks_of({place.left, place.right});
  const Span columns = {along.first << BLOCK_SHIFT, block_span(along.last - 1, map.columns).last};
  const double instant = instant_of_update(samples.time, map.clocks[0].delay, map.shown, intervals.most);
  for (std::ptrdiff_t block_row = touched.first; block_row < touched.last; ++block_row) {
    const Span rows = block_span(block_row, map.rows);
    std::optional<ShownGround> shown;
    if (map.blends()) shown.emplace(map, rows, columns, instant);
    note_blocks(map, place, samples, intervals, block_row, blocks);
    for (std::ptrdiff_t row = rows.first; row < rows.last; ++row)  // in the order of memory
      for (const BlockUpdate& block : blocks) take_part(map, place, samples, row, block);
    for (std::ptrdiff_t k = along.first; k < along.last; ++k)
      set_blend(map.clocks[block_row * map.block_columns + k], instant, map);
    if (shown) shown->write_deviations(map);
  }
  map.revision = next_revision();
}

}  // namespace smartmesh
