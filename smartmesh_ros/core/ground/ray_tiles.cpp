#include "ground/ray_tiles.h"

#include <limits>

namespace smartmesh {

RayTiles::RayTiles(const HeightGrid& grid, int pad) : grid_(&grid), pad_(pad) {
  rows_ = (last_row() + TILE - 1) / TILE;
  columns_ = (last_column() + TILE - 1) / TILE;
  tiles_.resize(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_));
}

const RayTile& RayTiles::at(int row, int column, TileReader& maps, std::size_t number) {
  RayTile& tile = tiles_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + column];
  if (tile.instant != instant_) {
    tile.instant = instant_;
    if (!tile.heights) tile.heights.reset(new double[SIDE * SIDE]);
    fill(tile, row * TILE - pad_, column * TILE - pad_, maps, number);
  }
  return tile;
}

void RayTiles::fill(RayTile& tile, int first_row, int first_column, TileReader& maps, std::size_t number) const {
  tile.low = std::numeric_limits<double>::infinity(), tile.high = -tile.low;
  for (int a = 0; a < SIDE; ++a) {
    double* heights = tile.heights.get() + a * SIDE;
    maps.tiles()[number].reader.read_row(first_row + a, first_column, SIDE, heights);
    if (pad_ > 0) fill_padding(first_row + a, first_column, heights, maps, number);
    for (int b = 0; b < SIDE; ++b) {
      tile.low = heights[b] < tile.low ? heights[b] : tile.low;
      tile.high = heights[b] > tile.high ? heights[b] : tile.high;
    }
  }
}

// Writes those heights of a row of samples that lie beyond the edge of the map.
void RayTiles::fill_padding(int row, int first_column, double* heights, TileReader& maps, std::size_t number) const {
  if (row >= grid_->rows + pad_) return;
  const bool beyond = row < 0 || row >= grid_->rows;
  for (int b = 0; b < SIDE; ++b) {
    const int column = first_column + b;
    if ((beyond || column < 0 || column >= grid_->columns) && column < grid_->columns + pad_)
      heights[b] = maps.across(number, row, column).height;
  }
}

}  // namespace smartmesh
