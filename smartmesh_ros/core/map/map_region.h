// Rectangles of the samples of a height map, and its blocks.
#pragma once

#include <algorithm>
#include <cstddef>

#include "map/height_grid.h"

namespace smartmesh {

// Rectangle of samples: first row and column, and the row and column after the last.
struct Region {
  std::ptrdiff_t top = 0, left = 0, bottom = 0, right = 0;

  std::ptrdiff_t width() const { return right - left; }
  std::ptrdiff_t size() const { return (bottom - top) * (right - left); }
  bool has_row(std::ptrdiff_t row) const { return row >= top && row < bottom; }
};

// Rows or columns of samples from `first` to `last` - 1.
struct Span {
  std::ptrdiff_t first, last;

  Span within(std::ptrdiff_t low, std::ptrdiff_t high) const { return {std::max(first, low), std::min(last, high)}; }
};

// Returns the samples of a row or column of blocks, in a map with `count` samples along it.
inline Span block_span(std::ptrdiff_t block, std::ptrdiff_t count) {
  return {block << BLOCK_SHIFT, std::min((block + 1) << BLOCK_SHIFT, count)};
}

// Returns the blocks that the samples of a span touch.
inline Span blocks_of(const Span& samples) {
  return {samples.first >> BLOCK_SHIFT, ((samples.last - 1) >> BLOCK_SHIFT) + 1};
}

}  // namespace smartmesh
