// Heights of the ground at a pattern of points around poses.
#include <algorithm>
#include <cmath>

#include "ground/tiles.h"

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
    return NONE;
  const int r = static_cast<int>(place.row), c = static_cast<int>(place.column);
  const double v = place.row - r, u = place.column - c;
  const int above = u < v;  // a number, because a branch here would be guessed wrong at every second point
  return (1.0 - std::max(u, v)) * tile.reader.height(r, c) +
         std::abs(u - v) * tile.reader.height(r + above, c + 1 - above) +
         std::min(u, v) * tile.reader.height(r + 1, c + 1);
}

// Writes the heights at a pattern of points, none farther than `radius` [m], in the frame of one pose.
void scan(GroundReader& ground, const double* pose, const double* pattern, std::size_t points, double radius,
          double* heights) {
  const double x = pose[0], y = pose[1], cos = std::cos(pose[2]), sin = std::sin(pose[2]);
  // Most points lie in whole cells of one map, without a mesh or a deck above: they are read there. All others are
  // asked of the tiles.
  Tile* map = ground.meshes.empty() && ground.decks == nullptr ? first_map_near(ground, x, y, radius) : nullptr;
  GridPoint start{0.0, 0.0}, forward{0.0, 0.0};
  if (map != nullptr) {
    const double size = map->grid->resolution;
    start = map->place(x, y);
    forward = {(sin * map->pose.cos - cos * map->pose.sin) / size, (cos * map->pose.cos + sin * map->pose.sin) / size};
  }
  for (std::size_t k = 0; k < points; ++k) {
    const double u = pattern[2 * k], v = pattern[2 * k + 1];
    if (map != nullptr) {
      const GridPoint place{start.row + u * forward.row + v * forward.column,
                            start.column + u * forward.column - v * forward.row};
      heights[k] = height_inside(*map, place);
      if (!std::isnan(heights[k])) continue;
    }
    heights[k] = ground.highest(x + u * cos - v * sin, y + u * sin + v * cos).height;
  }
}

}  // namespace

void scan_heights(GroundReader& ground, const double* poses, std::size_t count, const double* pattern,
                  std::size_t points, double farthest, double* heights) {
  double radius = 0.0;
  for (std::size_t k = 0; k < points; ++k) radius = std::max(radius, std::hypot(pattern[2 * k], pattern[2 * k + 1]));
  for (std::size_t k = 0; k < count; ++k, heights += points) {
    const double* pose = poses + 3 * k;
    if (std::all_of(pose, pose + 3, [&](double value) { return std::abs(value) <= farthest; }))
      scan(ground, pose, pattern, points, radius, heights);
    else
      std::fill_n(heights, points, NONE);
  }
}

}  // namespace smartmesh
