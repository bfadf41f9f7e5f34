#include "ground/tile_reader.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace smartmesh {

namespace {

// Share of a cell by which a gap between maps may be wider than a cell, against rounding.
constexpr double GAP_ROUNDING = 1e-6;

}  // namespace

double Tile::beyond(const GridPoint& p) const {
  return std::max({-p.row, -p.column, p.row - (grid->rows - 1), p.column - (grid->columns - 1)}) * grid->resolution;
}

TileReader::TileReader(const std::vector<HeightGrid*>& grids, double time, double ahead) : time_(time), ahead_(ahead) {
  tiles_.reserve(grids.size());
  for (const HeightGrid* grid : grids) {
    tiles_.push_back({grid, grid->pose_at(time), GridReader(*grid, time, ahead)});
    widest_gap_ = std::max(widest_gap_, grid->resolution * (1.0 + GAP_ROUNDING));
  }
}

TileReader::TileReader(const std::vector<const MapAtInstant*>& maps, double widest_cell, double time, double ahead)
    : time_(time), ahead_(ahead), widest_gap_(widest_cell * (1.0 + GAP_ROUNDING)) {
  tiles_.reserve(maps.size());
  for (const MapAtInstant* map : maps) tiles_.push_back({map->grid, map->pose, GridReader(*map->grid, time, ahead)});
}

TileFacet TileReader::on_maps(double x, double y, double z, bool& on_any) {
  on_any = false;
  for (Tile& tile : tiles_) {
    const GridPoint place = tile.place(x, y);
    if (!is_on(*tile.grid, place)) continue;
    on_any = true;
    const GridFacet facet = facet_at(*tile.grid, tile.reader, clamped(*tile.grid, place), ahead_);
    if (facet.height <= z) return {facet, &tile};
  }
  return {};
}

TileFacet TileReader::at(double x, double y, double z) {
  bool on_any;
  const TileFacet here = on_maps(x, y, z, on_any);
  if (here.tile != nullptr) return here;
  if (on_any || tiles_.size() < 2) return {};
  const TileFacet found = in_gap(x, y);
  return found.facet.height <= z ? found : TileFacet{};
}

bool TileReader::is_on_any(double x, double y) const {
  return std::any_of(tiles_.begin(), tiles_.end(),
                     [&](const Tile& tile) { return is_on(*tile.grid, tile.place(x, y)); });
}

TileFacet TileReader::in_gap(double x, double y) {
  if (by_fineness_.empty()) {
    by_fineness_.resize(tiles_.size());
    std::iota(by_fineness_.begin(), by_fineness_.end(), std::size_t{0});
    std::stable_sort(by_fineness_.begin(), by_fineness_.end(), [&](std::size_t a, std::size_t b) {
      return tiles_[a].grid->resolution < tiles_[b].grid->resolution;
    });
  }
  for (std::size_t k : by_fineness_) {
    const GridPoint place = tiles_[k].place(x, y);
    if (!(tiles_[k].beyond(place) <= widest_gap_)) continue;
    const double r = std::floor(place.row), c = std::floor(place.column), v = place.row - r, u = place.column - c;
    const bool above = u < v;
    const GridFacet facet = facet_of(across(k, r, c), above ? across(k, r + 1.0, c) : across(k, r, c + 1.0),
                                     across(k, r + 1.0, c + 1.0), v, u, above, ahead_);
    if (!std::isnan(facet.height)) return {facet, &tiles_[k]};
  }
  return {};
}

Sample TileReader::across(std::size_t number, double row, double column) {
  Tile& tile = tiles_[number];
  const HeightGrid& grid = *tile.grid;
  if (row >= 0.0 && column >= 0.0 && row < grid.rows && column < grid.columns)
    return tile.reader.read(static_cast<int>(row), static_cast<int>(column));
  const Vec3 at = tile.pose.point({row, column}, grid.resolution);
  const GroundPoint ground = sample(at.x, at.y);
  return {ground.height, ground.velocity.z * ahead_};
}

GroundPoint TileReader::sample(double x, double y) {
  bool on_any;
  const TileFacet here = on_maps(x, y, ABOVE_ALL, on_any);
  if (here.tile != nullptr) return {here.facet.height, here.tile->velocity(x, y, here.facet.velocity, ahead_)};
  return on_any ? GroundPoint{} : bridged(x, y);
}

// Interpolates between the edges of maps, of which at least two lie on different sides.
GroundPoint TileReader::bridged(double x, double y) {
  double weights = 0.0;
  GroundPoint sum{0.0, {}};
  bool is_between = false;
  std::vector<Vec3> ways;  // to the edges [m]
  for (Tile& tile : tiles_) {
    const GridPoint place = tile.place(x, y), nearest = clamped(*tile.grid, place);
    const double distance = tile.beyond(place);
    if (!(distance > 0.0 && distance <= widest_gap_)) continue;
    const GridFacet edge = facet_at(*tile.grid, tile.reader, nearest, ahead_);
    if (std::isnan(edge.height)) continue;
    weights += 1.0 / distance;
    sum.height += edge.height / distance;
    sum.velocity = sum.velocity + tile.velocity(x, y, edge.velocity, ahead_) * (1.0 / distance);
    const Vec3 way = tile.pose.point(nearest, tile.grid->resolution) - Vec3{x, y, 0.0};
    for (const Vec3& other : ways) is_between |= way.x * other.x + way.y * other.y < 0.0;
    ways.push_back(way);
  }
  return is_between ? GroundPoint{sum.height / weights, sum.velocity * (1.0 / weights)} : GroundPoint{};
}

bool TileReader::continues(std::size_t number, double x, double y) {
  const Tile& tile = tiles_[number];
  return is_on(*tile.grid, tile.place(x, y)) || (!is_on_any(x, y) && in_gap(x, y).tile == &tile);
}

}  // namespace smartmesh
