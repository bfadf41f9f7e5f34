// Rays onto a moving height map: a traversal of tiles and cells (Amanatides and Woo, *A Fast Voxel Traversal Algorithm
// for Ray Tracing*, 1987).
//
// A ray is followed through the cells of a tile only where it is between the tile's lowest and highest height. In a
// cell the gap between ray and ground is linear on each side of the diagonal, so the ray meets the ground where the gap
// changes its sign. The gap at the end of one facet is the gap at the start of the next, so that no ray slips through
// an edge. The heights of one instant are computed tile by tile when the first ray visits a tile.
#pragma once

#include <memory>
#include <vector>

#include "ground/tile_reader.h"
#include "mesh/mesh_surface.h"

namespace smartmesh {

// Heights of a tile [m], row by row, and their range, at the instant with this number.
struct RayTile {
  long instant = 0;
  double low = 0.0, high = 0.0;
  std::unique_ptr<double[]> heights;
};

// The lattice of a map, which goes on by `pad` samples beyond each edge, over the gaps to other maps.
class RayTiles {
 public:
  // Side of a tile [cells]. A larger one skips more ground in one step, and computes more heights that no ray needs.
  static constexpr int TILE = 16;
  static constexpr int SIDE = TILE + 1;  // samples along a side, including those shared with the next tile

  RayTiles(const HeightGrid& grid, int pad);

  // Forgets the heights, after the ground has moved.
  void forget() { ++instant_; }

  // Returns a tile. `maps`: at the instant; `number`: of this map among them.
  const RayTile& at(int row, int column, TileReader& maps, std::size_t number);

  int pad() const { return pad_; }
  // Row and column of the last sample, with the padding, and numbers of rows and columns of tiles.
  int last_row() const { return grid_->rows - 1 + 2 * pad_; }
  int last_column() const { return grid_->columns - 1 + 2 * pad_; }
  int rows() const { return rows_; }
  int columns() const { return columns_; }
  bool is_padding(int row, int column) const {
    return row < pad_ || column < pad_ || row >= grid_->rows - 1 + pad_ || column >= grid_->columns - 1 + pad_;
  }

 private:
  void fill(RayTile& tile, int first_row, int first_column, TileReader& maps, std::size_t number) const;
  void fill_padding(int row, int first_column, double* heights, TileReader& maps, std::size_t number) const;

  const HeightGrid* grid_;
  int pad_, rows_, columns_;
  std::vector<RayTile> tiles_;
  long instant_ = 1;
};

struct Ray {
  Vec3 from, way;  // `way` has length one
  double range;    // [m]
};

// Returns the first hit of a ray on the map with this `number` among `maps`, from either side. `tiles`: of that map.
RayHit first_hit(const Ray& ray, RayTiles& tiles, TileReader& maps, std::size_t number);

}  // namespace smartmesh
