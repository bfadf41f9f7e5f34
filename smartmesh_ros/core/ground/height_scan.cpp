#include "ground/height_scan.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Returns the first map that any point within a radius [m] of (x, y) may lie on; null = none.
Tile* first_map_near(GroundReader& ground, double x, double y, double radius) {
  for (Tile& tile : ground.tiles.tiles())
    if (!(tile.beyond(tile.place(x, y)) > radius + EDGE * tile.grid->resolution)) return &tile;
  return nullptr;
}

// Returns the height of a place inside a map [m]; NaN on its outermost row and column, and in cells with a hole.
double height_inside(Tile& tile, const GridPoint& place) {
  if (!(place.row >= 0.0 && place.column >= 0.0 && place.row < tile.grid->rows - 1 &&
        place.column < tile.grid->columns - 1))
    return std::numeric_limits<double>::quiet_NaN();
  const int r = static_cast<int>(place.row), c = static_cast<int>(place.column);
  const double v = place.row - r, u = place.column - c;
  const int above = u < v;  // a number, because a branch here would be guessed wrong at every second point
  return (1.0 - std::max(u, v)) * tile.reader.height(r, c) +
         std::abs(u - v) * tile.reader.height(r + above, c + 1 - above) +
         std::min(u, v) * tile.reader.height(r + 1, c + 1);
}

}  // namespace

double ScanPattern::radius() const {
  double farthest = 0.0;
  for (std::size_t k = 0; k < count; ++k) farthest = std::max(farthest, std::hypot(points[2 * k], points[2 * k + 1]));
  return farthest;
}

void scan_heights(GroundReader& ground, const ScanPose& pose, const ScanPattern& pattern, double radius,
                  double* heights) {
  const double cos = std::cos(pose.yaw), sin = std::sin(pose.yaw);
  // Most points lie in whole cells of one map, without a mesh or a deck above: they are read there. All others are
  // asked of the tiles.
  Tile* map =
      ground.meshes.empty() && ground.decks == nullptr ? first_map_near(ground, pose.x, pose.y, radius) : nullptr;
  GridPoint start{0.0, 0.0}, forward{0.0, 0.0};
  if (map != nullptr) {
    const double size = map->grid->resolution;
    start = map->place(pose.x, pose.y);
    forward = {(sin * map->pose.cos - cos * map->pose.sin) / size, (cos * map->pose.cos + sin * map->pose.sin) / size};
  }
  for (std::size_t k = 0; k < pattern.count; ++k) {
    const double u = pattern.points[2 * k], v = pattern.points[2 * k + 1];
    if (map != nullptr) {
      const GridPoint place{start.row + u * forward.row + v * forward.column,
                            start.column + u * forward.column - v * forward.row};
      heights[k] = height_inside(*map, place);
      if (!std::isnan(heights[k])) continue;
    }
    heights[k] = ground.at(pose.x + u * cos - v * sin, pose.y + u * sin + v * cos).height;
  }
}

}  // namespace smartmesh
