#include "map/map_corrections.h"

#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

constexpr double NEVER = std::numeric_limits<double>::infinity();

// Writes `count` heights and the offsets from them to the heights shown before, of which a share `left` of the offsets
// was left.
void correct(float* heights, float* offsets, const float* known, std::ptrdiff_t count, float left) {
  int filled = 0;
  for (std::ptrdiff_t c = 0; c < count; ++c) {
    const float offset = heights[c] + left * offsets[c] - known[c];
    offsets[c] = std::isnan(known[c]) ? 0.0f : offset;
    heights[c] = known[c];
    filled |= std::isnan(offsets[c]) ? 1 : 0;
  }
  if (filled == 0) return;
  float before = 0.0f;
  for (std::ptrdiff_t c = 0; c < count; ++c) {
    if (std::isnan(offsets[c])) offsets[c] = before;
    before = offsets[c];
  }
}

// Writes the heights of a row that was not shown yet.
void set(float* heights, float* offsets, const float* known, std::ptrdiff_t count) {
  for (std::ptrdiff_t c = 0; c < count; ++c) heights[c] = known[c], offsets[c] = 0.0f;
}

// Writes the part of a row that is in one block, of whose correction before a share `left` is not blended in.
void correct_part(HeightGrid& map, const Region& place, const NewEstimate& estimate, std::ptrdiff_t row,
                  const Span& columns, float left) {
  float *heights = map.heights + row * map.columns, *offsets = map.offsets + row * map.columns;
  const Span inside = place.has_row(row) ? columns.within(place.left, place.right) : Span{columns.last, columns.last};
  for (std::ptrdiff_t c = columns.first; c < inside.first; ++c) offsets[c] *= left;
  for (std::ptrdiff_t c = inside.last; c < columns.last; ++c) offsets[c] *= left;
  if (inside.first == inside.last) return;
  const float* known = estimate.heights + (row - place.top) * place.width() + inside.first - place.left;
  const std::ptrdiff_t at = inside.first, count = inside.last - at;
  if (estimate.shown == NEVER)
    set(heights + at, offsets + at, known, count);
  else
    correct(heights + at, offsets + at, known, count, left);
}

}  // namespace

void take_corrected(HeightGrid& map, const Region& place, const NewEstimate& estimate) {
  const Span down = blocks_of({place.top, place.bottom}), along = blocks_of({place.left, place.right});
  for (std::ptrdiff_t block_row = down.first; block_row < down.last; ++block_row) {
    Clock* clocks = map.clocks + block_row * map.block_columns;
    const Span rows = block_span(block_row, map.rows);
    for (std::ptrdiff_t row = rows.first; row < rows.last; ++row)  // in the order of memory
      for (std::ptrdiff_t k = along.first; k < along.last; ++k)
        correct_part(map, place, estimate, row, block_span(k, map.columns),
                     static_cast<float>(remaining(clocks[k], estimate.shown, estimate.settle)));
    for (std::ptrdiff_t k = along.first; k < along.last; ++k) {
      clocks[k].middle = estimate.shown == NEVER ? estimate.time : estimate.shown;
      clocks[k].time = estimate.time, clocks[k].known = 0, clocks[k].lifetime = 0.0;
      ++clocks[k].updates;
    }
  }
  if (estimate.shown != NEVER) map.settled = estimate.shown + estimate.settle;
  map.revision = next_revision();
}

}  // namespace smartmesh
