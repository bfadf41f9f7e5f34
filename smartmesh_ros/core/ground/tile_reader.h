// Reader of several height maps as one at one instant, with the gaps between them.
#pragma once

#include <cmath>
#include <vector>

#include "map/grid_facet.h"
#include "mesh/mesh_surface.h"

namespace smartmesh {

// Duration over which a velocity is that of an instant [s], as in terrain/motion.py.
constexpr double INSTANT = 1e-9;
// Height of a point above all ground [m].
constexpr double ABOVE_ALL = 1e300;

// A height map where it is at an instant. `bounds`: of its samples; they hold for x and y. `cells`: under what was last
// looked for.
struct MapAtInstant {
  HeightGrid* grid;
  GridPose pose;
  Bounds bounds;
  CellRange cells{};
};

// One of the height maps at the instant.
struct Tile {
  const HeightGrid* grid;
  GridPose pose;
  GridReader reader;

  GridPoint place(double x, double y) const { return to_grid(pose, grid->resolution, x, y); }

  // Returns how far a place lies outside the map [m], along the axis where it is farthest.
  double beyond(const GridPoint& p) const;
  // Returns the mean velocity of a facet of the map at (x, y) over the time `ahead` [m/s]. `vertical` [m/s]: its
  // vertical velocity there.
  Vec3 velocity(double x, double y, double vertical, double ahead) const {
    const Vec3 slide = pose.mean_slide(x, y, ahead);
    return {slide.x, slide.y, vertical};
  }
  // Returns the upward unit normal of a facet whose height changes so much per column and row [m].
  Vec3 normal(double per_column, double per_row) const {
    const double east = -per_column / grid->resolution, north = -per_row / grid->resolution;
    const double up = 1.0 / std::sqrt(1.0 + east * east + north * north);
    return {(east * pose.cos - north * pose.sin) * up, (east * pose.sin + north * pose.cos) * up, up};
  }
};

// A facet and the map whose lattice it belongs to; null = no ground.
struct TileFacet {
  GridFacet facet;
  const Tile* tile = nullptr;
};

// A point on several maps belongs to the first one that has ground there. Gaps of up to a cell between maps are ground:
// there the lattice of the finest map in reach goes on, with samples interpolated between the edges of the maps around.
// A hole of a map is no gap.
class TileReader {
 public:
  // Velocities are means over the time `ahead` [s].
  TileReader(const std::vector<HeightGrid*>& grids, double time, double ahead);
  // For some of the maps of a terrain, which bridges gaps of `widest_cell` [m].
  TileReader(const std::vector<const MapAtInstant*>& maps, double widest_cell, double time, double ahead);

  // Returns the facet at (x, y). Ground above `z` [m] does not count.
  TileFacet at(double x, double y, double z = ABOVE_ALL);

  // Returns the ground at a sample of a lattice that goes on beyond the edge of its map.
  GroundPoint sample(double x, double y);
  Sample across(std::size_t tile, double row, double column);

  // Returns true if a place beyond the edge of a map is on the facets that continue it.
  bool continues(std::size_t tile, double x, double y);

  std::vector<Tile>& tiles() { return tiles_; }
  double time() const { return time_; }
  double ahead() const { return ahead_; }
  // Returns the widest gap that is bridged [m].
  double widest_gap() const { return widest_gap_; }

 private:
  // Returns the facet of the first map that has ground at (x, y) up to `z` [m]. `on_any`: true if (x, y) is on a map.
  TileFacet on_maps(double x, double y, double z, bool& on_any);
  TileFacet in_gap(double x, double y);
  bool is_on_any(double x, double y) const;
  GroundPoint bridged(double x, double y);

  std::vector<Tile> tiles_;
  std::vector<std::size_t> by_fineness_;
  double time_, ahead_, widest_gap_ = 0.0;
};

}  // namespace smartmesh
