#include "ground/ray_grid.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

constexpr int TILE = RayTiles::TILE, SIDE = RayTiles::SIDE;
// Distance from heights within which a ray is still checked against facets [m], and from the lattice's edge [cells]:
// rounding.
constexpr double CLOSE = 1e-9, RIM = 1e-6;
// Change of a coordinate per metre below which a ray does not move along it.
constexpr double NO_RATE = 1e-200;

// A coordinate along a ray: at its start, its change per metre and the reciprocal of that, zero = it does not change.
struct Coordinate {
  double start, rate, inverse;

  Coordinate(double from, double per_metre)
      : start(from), rate(std::abs(per_metre) < NO_RATE ? 0.0 : per_metre), inverse(rate == 0.0 ? 0.0 : 1.0 / rate) {}

  double at(double s) const { return start + rate * s; }

  // Limits the part of the ray from `begin` to `end` [m] to that in which the coordinate is between `low` and `high`.
  void clip(double low, double high, double& begin, double& end) const {
    if (rate == 0.0) {
      if (!(low <= start && start <= high)) begin = INFINITE;
      return;
    }
    const double first = (low - start) * inverse, second = (high - start) * inverse;
    begin = std::max(begin, std::min(first, second));
    end = std::min(end, std::max(first, second));
  }
  // Returns the distance [m] at which the coordinate leaves the range from `low` to `high`.
  double leaves(int low, int high) const {
    if (rate == 0.0) return INFINITE;
    return ((rate > 0.0 ? high : low) - start) * inverse;
  }
  // Returns the cell, from `first` to the one before `last`, at the distance `s` [m].
  int cell(double s, int first, int last) const {
    return static_cast<int>(std::min(last - 1.0, std::max<double>(first, std::floor(at(s)))));
  }
  int step() const { return rate > 0.0 ? 1 : -1; }
};

// A hit at a distance [m], and the changes of the facet's height per column and row [m].
struct FacetHit {
  double distance = INFINITE, per_column = 0.0, per_row = 0.0;
};

class Walk {
 public:
  Walk(const Ray& ray, RayTiles& tiles, TileReader& maps, std::size_t number)
      : tiles_(tiles),
        maps_(maps),
        number_(number),
        tile_(maps.tiles()[number]),
        range_(ray.range),
        row_(0.0, 0.0),
        column_(0.0, 0.0),
        z_(ray.from.z, ray.way.z) {
    const GridPose& pose = tile_.pose;
    const GridPoint from = tile_.place(ray.from.x, ray.from.y);
    const double dx = ray.way.x / tile_.grid->resolution, dy = ray.way.y / tile_.grid->resolution;
    row_ = {from.row + tiles.pad(), dy * pose.cos - dx * pose.sin};
    column_ = {from.column + tiles.pad(), dx * pose.cos + dy * pose.sin};
  }

  FacetHit first_hit() {
    double begin = 0.0, end = range_;
    row_.clip(-RIM, tiles_.last_row() + RIM, begin, end);
    column_.clip(-RIM, tiles_.last_column() + RIM, begin, end);
    if (!(begin <= end)) return {};
    int r = row_.cell(begin, 0, tiles_.last_row()) / TILE, c = column_.cell(begin, 0, tiles_.last_column()) / TILE;
    while (r >= 0 && c >= 0 && r < tiles_.rows() && c < tiles_.columns()) {
      const double leave_row = row_.leaves(r * TILE, (r + 1) * TILE);
      const double leave_column = column_.leaves(c * TILE, (c + 1) * TILE);
      const double leave = std::max(std::min({leave_row, leave_column, end}), begin);
      const FacetHit hit = in_tile(r, c, begin, leave);
      if (hit.distance <= range_) return hit;
      if (leave >= end) break;
      begin = leave;
      if (leave_row <= leave_column) r += row_.step();
      if (leave_column <= leave_row) c += column_.step();
    }
    return {};
  }

 private:
  FacetHit in_tile(int tile_row, int tile_column, double begin, double leave) {
    const RayTile& tile = tiles_.at(tile_row, tile_column, maps_, number_);
    double s = begin, end = leave;
    if (tile.low <= tile.high)
      z_.clip(tile.low - CLOSE, tile.high + CLOSE, s, end);
    else
      s = INFINITE;  // holes
    if (s > begin) gap_ = NONE;
    const int first_row = tile_row * TILE, end_row = std::min(first_row + TILE, tiles_.last_row());
    const int first_column = tile_column * TILE, end_column = std::min(first_column + TILE, tiles_.last_column());
    if (!(s <= end)) return {};
    int r = row_.cell(s, first_row, end_row), c = column_.cell(s, first_column, end_column);
    while (r >= first_row && c >= first_column && r < end_row && c < end_column) {
      const double leave_row = row_.leaves(r, r + 1), leave_column = column_.leaves(c, c + 1);
      const double next = std::max(std::min({leave_row, leave_column, end}), s);
      const FacetHit hit = in_cell(tile.heights.get() + (r - first_row) * SIDE + c - first_column, r, c, s, next);
      if (hit.distance <= end) return hit;
      if (next >= end) break;
      s = next;
      if (leave_row <= leave_column) r += row_.step();
      if (leave_column <= leave_row) c += column_.step();
    }
    if (end < leave) gap_ = NONE;
    return {};
  }

  // Returns the first hit in a cell between the distances `s` and `leave` [m]. `at`: height of the cell's first sample.
  FacetHit in_cell(const double* at, int row, int column, double s, double leave) {
    const double near = at[0], right = at[1], above = at[SIDE], far = at[SIDE + 1];
    if (passes(std::min(z_.at(s), z_.at(leave)) - CLOSE, std::max(z_.at(s), z_.at(leave)) + CLOSE, at)) {
      gap_ = NONE;
      return {};
    }
    const double v = row_.start - row, u = column_.start - column, across = column_.rate - row_.rate;
    const double diagonal = across != 0.0 ? (v - u) / across : leave;
    for (double stop : {std::min(std::max(diagonal, s), leave), leave}) {
      if (!(stop > s)) continue;
      const double middle = 0.5 * (s + stop);
      const bool upper = v + row_.rate * middle > u + column_.rate * middle;
      const FacetHit plane{INFINITE, upper ? far - above : right - near, upper ? above - near : far - right};
      const double hit = crossing(near, plane, v, u, s, stop);
      if (hit < INFINITE && counts(row, column, hit)) return {hit, plane.per_column, plane.per_row};
      s = stop;
    }
    return {};
  }

  // Returns true if a ray between the heights `low` and `high` [m] passes above or below all corners of a cell.
  static bool passes(double low, double high, const double* at) {
    return (low > at[0] && low > at[1] && low > at[SIDE] && low > at[SIDE + 1]) ||
           (high < at[0] && high < at[1] && high < at[SIDE] && high < at[SIDE + 1]);
  }

  // Returns the distance between `begin` and `end` [m] at which the ray meets a facet, infinity if it does not, and
  // notes the gap at the end. (`v`, `u`): the start of the ray in the cell.
  double crossing(double near, const FacetHit& plane, double v, double u, double begin, double end) {
    const auto gap_at = [&](double s) {
      const double place = near + (u + column_.rate * s) * plane.per_column + (v + row_.rate * s) * plane.per_row;
      return z_.at(s) - place;
    };
    const double gap = std::isnan(gap_) ? gap_at(begin) : gap_, after = gap_at(end);
    gap_ = after;
    if (gap == 0.0) return begin;
    if ((gap > 0.0 && after <= 0.0) || (gap < 0.0 && after >= 0.0)) return begin + (end - begin) * gap / (gap - after);
    return INFINITE;
  }

  // Returns false for a hit on the padding where another map, or the padding of another one, is the ground.
  bool counts(int row, int column, double s) {
    if (!tiles_.is_padding(row, column)) return true;
    const GridPoint place{row_.at(s) - tiles_.pad(), column_.at(s) - tiles_.pad()};
    const Vec3 at = tile_.pose.point(place, tile_.grid->resolution);
    return maps_.continues(number_, at.x, at.y);
  }

  RayTiles& tiles_;
  TileReader& maps_;
  const std::size_t number_;
  const Tile& tile_;
  const double range_;
  Coordinate row_, column_, z_;
  double gap_ = NONE;  // between ray and ground [m] at the end of the last facet, NaN = unknown
};

}  // namespace

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
  tile.low = INFINITE, tile.high = -tile.low;
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

RayHit first_hit(const Ray& ray, RayTiles& tiles, TileReader& maps, std::size_t number) {
  const FacetHit hit = Walk(ray, tiles, maps, number).first_hit();
  if (hit.distance == INFINITE) return {};
  return {hit.distance, maps.tiles()[number].normal(hit.per_column, hit.per_row)};
}

}  // namespace smartmesh
