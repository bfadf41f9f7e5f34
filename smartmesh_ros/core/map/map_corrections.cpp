#include "map/map_updates.h"

#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

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
void correct_part(HeightGrid& map, const Region& place, const float* fresh, std::ptrdiff_t row, const Span& columns,
                  float left) {
  float *heights = map.heights + row * map.columns, *offsets = map.offsets + row * map.columns;
  const Span inside = place.has_row(row) ? columns.within(place.left, place.right) : Span{columns.last, columns.last};
  for (std::ptrdiff_t c = columns.first; c < inside.first; ++c) offsets[c] *= left;
  for (std::ptrdiff_t c = inside.last; c < columns.last; ++c) offsets[c] *= left;
  if (inside.first == inside.last) return;
  const float* known = fresh + (row - place.top) * place.width() + inside.first - place.left;
  const std::ptrdiff_t at = inside.first, count = inside.last - at;
  if (map.shown == INFINITE)
    set(heights + at, offsets + at, known, count);
  else
    correct(heights + at, offsets + at, known, count, left);
}

}  // namespace

void take_corrected(HeightGrid& map, const Region& place, const float* heights, double time) {
  const Span down = blocks_of({place.top, place.bottom}), along = blocks_of({place.left, place.right});
  for (std::ptrdiff_t block_row = down.first; block_row < down.last; ++block_row) {
    Clock* clocks = map.clocks + block_row * map.block_columns;
    const Span rows = block_span(block_row, map.rows);
    for (std::ptrdiff_t row = rows.first; row < rows.last; ++row)  // in the order of memory
      for (std::ptrdiff_t k = along.first; k < along.last; ++k)
        correct_part(map, place, heights, row, block_span(k, map.columns),
                     static_cast<float>(remaining(clocks[k], map.shown, map.settle)));
    for (std::ptrdiff_t k = along.first; k < along.last; ++k) {
      clocks[k].middle = map.shown == INFINITE ? time : map.shown;
      clocks[k].time = time, clocks[k].known = 0, clocks[k].lifetime = 0.0;
      ++clocks[k].updates;
    }
  }
  if (map.shown != INFINITE) map.settled = map.shown + map.settle;
  map.revision = next_revision();
}

// Without branches, so that the compiler computes several samples at once.
void fuse(float* heights, float* variances, const float* measured, const float* noises, std::size_t count, float grown,
          float gate_squared) {
  for (std::size_t c = 0; c < count; ++c) {
    const float known = heights[c], seen = measured[c], noise = noises[c];
    const float prior = variances[c] + grown, innovation = seen - known, spread = prior + noise, gain = prior / spread;
    const bool is_seen = (seen == seen) & (noise >= 0.0f) & (noise < std::numeric_limits<float>::infinity());
    // The comparison is false for a sample without a height (NaN), which therefore starts from the measurement.
    const bool agrees = (noise > 0.0f) & (innovation * innovation <= gate_squared * spread);
    const float height = agrees ? known + gain * innovation : seen, variance = agrees ? gain * noise : noise;
    heights[c] = is_seen ? height : known;
    variances[c] = is_seen ? variance : prior;
  }
}

}  // namespace smartmesh
