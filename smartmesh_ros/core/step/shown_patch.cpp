#include "step/shown_patch.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Samples on each side of the middle of the largest patch. Larger bodies get fewer samples than the map has.
constexpr int MOST_RINGS = 32;
// Height up to which, and depth to which, a body that always has a patch looks for meshes [m].
constexpr double ANY_HEIGHT = 1e9;
// Bits of a vertex in its name; above them is one more than the number of the mesh.
constexpr int NAME_BITS = 40;
// Part of a cell that does not make a patch larger, against rounding.
constexpr double ROUNDING = 1e-9;

double distance_to(double value, double low, double high) { return std::max({low - value, value - high, 0.0}); }

// Returns the squared distance from a point to a triangle, both seen from above.
double distance2_seen_from_above(const Vec3& p, const std::array<std::int32_t, 3>& corners,
                                 const std::vector<Vec3>& points) {
  double least = 1e300;
  int left = 0, right = 0;
  for (int j = 0; j < 3; ++j) {
    const Vec3 a = points[corners[j]], b = points[corners[(j + 1) % 3]];
    const double ux = b.x - a.x, uy = b.y - a.y, px = p.x - a.x, py = p.y - a.y, length2 = ux * ux + uy * uy;
    const double along = length2 > 0.0 ? std::clamp((px * ux + py * uy) / length2, 0.0, 1.0) : 0.0;
    const double x = px - along * ux, y = py - along * uy, side = ux * py - uy * px;
    least = std::min(least, x * x + y * y);
    left += side >= 0.0, right += side <= 0.0;
  }
  return left == 3 || right == 3 ? 0.0 : least;
}

std::int64_t floor_of(double value) { return static_cast<std::int64_t>(std::floor(value)); }

}  // namespace

void ShownPatches::set_tiles(const std::vector<HeightGrid*>& maps, const std::vector<MeshSurface*>& meshes) {
  tiles_.set_all(maps, meshes);
  for (ShownPatch& patch : patches_) patch.square.tile = -1, patch.calm = false, patch.read = {};
}

// Returns the map that a point is over: that of before, or else the first one, or the nearest within a radius [m]; -1 =
// none.
int ShownPatches::map_under(const Vec3& p, double radius, int before, std::vector<Tile>& maps) const {
  const auto beyond = [&](int k) { return maps[k].beyond(maps[k].place(p.x, p.y)); };
  const int count = static_cast<int>(maps.size());
  if (before >= 0 && before < count && beyond(before) <= 0.0) return before;
  int nearest = -1;
  double least = radius;
  for (int k = 0; k < count; ++k) {
    const double away = beyond(k);
    if (away <= 0.0) return k;
    if (away <= least) nearest = k, least = away;
  }
  return nearest;
}

// Returns the square around the vertex nearest to a place. On a single map it stays on the map, so that it is complete.
PatchSquare ShownPatches::square_on(int tile, const GridPoint& place, double radius) const {
  const HeightGrid& map = *tiles_.maps()[tile];
  const int room = std::max((std::min(map.rows, map.columns) - 1) / 2, 1);
  // Half a cell more, because the square is centred on the nearest vertex instead of the body.
  const double wanted = std::ceil(radius / map.resolution + 0.5 - ROUNDING);
  const int cells = static_cast<int>(std::clamp(wanted, 1.0, static_cast<double>(room)));
  const int stride = (cells + MOST_RINGS - 1) / MOST_RINGS;
  const int rings = std::max(std::min((cells + stride - 1) / stride, room / stride), 1);
  PatchSquare found{tile, 0, 0, 2 * rings + 1, stride};
  const auto first = [&](double at, int size) {
    const std::int64_t start = floor_of(std::ceil(at - 0.5)) - static_cast<std::int64_t>(rings) * stride;
    if (tiles_.maps().size() > 1) return static_cast<int>(start);
    return static_cast<int>(std::max<std::int64_t>(std::min<std::int64_t>(start, size - 1 - 2 * rings * stride), 0));
  };
  found.row = first(place.row, map.rows), found.column = first(place.column, map.columns);
  return found;
}

void ShownPatches::search(const std::vector<std::int64_t>& slots, const std::vector<ReachingBody>& bodies,
                          double time) {
  TileReader reader(tiles_.maps(), time, INSTANT);
  const double gap = tiles_.maps().size() > 1 ? reader.widest_gap() : 0.0;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    ShownPatch& patch = patches_[slots[k]];
    patch.body = bodies[k];
    const Vec3& middle = bodies[k].middle;
    const double radius = bodies[k].radius;
    patch.square.tile = map_under(middle, std::max(radius, gap), patch.square.tile, reader.tiles());
    if (patch.square.tile < 0) continue;
    patch.place = reader.tiles()[patch.square.tile].place(middle.x, middle.y);
    patch.square = square_on(patch.square.tile, patch.place, radius);
  }
}

void ShownPatches::collect(const std::vector<std::int64_t>& slots, double time) {
  TileReader tiles(tiles_.maps(), time, INSTANT);
  for (std::int64_t slot : slots) {
    ShownPatch& patch = patches_[slot];
    const bool on_map = patch.square.tile >= 0;
    if (on_map) read_map(patch, tiles, time);
    patch.is_shown = true;
    if (on_map && patch.reaches_map())
      patch.is_mesh = false;
    else if (read_meshes(patch, time))
      patch.is_mesh = true;
    else if (on_map && patch.body.always && patch.highest > -1e300)
      patch.is_mesh = false, read_map(patch, tiles, time);
    else
      patch.is_shown = false;
    patch.of_mesh = patch.is_mesh;
    if (patch.is_shown) find_near(patch);
    patch.is_shown = patch.is_shown && !patch.near.empty();
  }
}

// Reads the samples of a patch's square, and the motion of the ground in its middle.
void ShownPatches::read_map(ShownPatch& patch, TileReader& tiles, double time) {
  const PatchSquare& square = patch.square;
  const bool is_new = patch.is_mesh || !(patch.read == square);
  if (is_new) {
    patch.read = square, patch.is_mesh = false, patch.updates = -1;
    const Tile& tile = tiles.tiles()[square.tile];
    patch.box = {};
    for (int row : {square.row, square.last_row()})
      for (int column : {square.column, square.last_column()})
        patch.box.add(tile.pose.point({static_cast<double>(row), static_cast<double>(column)}, tile.grid->resolution));
    tiles_.blocks_under(patch.box, time, patch.blocks);
  }
  const Updates now = tiles_.updates_of(patch.blocks, time);
  if (patch.calm && patch.updates == now.count) return;
  patch.updates = now.count, patch.calm = !now.moves && !now.settles;
  const Vec3 linear = patch.linear, angular = patch.angular;
  read_points(square, tiles, fresh_);
  read_motion(patch, tiles);
  const bool moved = norm2(patch.linear - linear) + norm2(patch.angular - angular) > 0.0;
  if (!moved && !is_new && are_same(fresh_, patch.points)) return;
  patch.tile = square.tile;
  patch.row = square.row + square.middle() * square.stride,
  patch.column = square.column + square.middle() * square.stride;
  patch.highest = -1e300;
  for (const Vec3& p : fresh_) patch.highest = std::max(patch.highest, std::isnan(p.z) ? -1e300 : p.z);
  patch.points.swap(fresh_);
  ++patch.points_revision;
  patch.triangles.clear();
  const int side = square.side;
  const auto add = [&](int a, int b, int c) {
    const auto& p = patch.points;
    if (!std::isnan(p[a].z + p[b].z + p[c].z)) patch.triangles.push_back({a, b, c});
  };
  for (int r = 0; r + 1 < side; ++r) {
    for (int c = 0; c + 1 < side; ++c) {
      const int a = r * side + c;
      add(a, a + 1, a + side + 1), add(a, a + side + 1, a + side);
    }
  }
}

void ShownPatches::read_points(const PatchSquare& square, TileReader& tiles, std::vector<Vec3>& points) const {
  Tile& tile = tiles.tiles()[square.tile];
  const HeightGrid& map = *tile.grid;
  points.resize(static_cast<std::size_t>(square.side) * square.side);
  auto next = points.begin();
  for (int r = 0; r < square.side; ++r) {
    const int row = square.row + r * square.stride;
    for (int c = 0; c < square.side; ++c) {
      const int column = square.column + c * square.stride;
      const GridPoint place{static_cast<double>(row), static_cast<double>(column)};
      const double height = map.has(row, column)       ? tile.reader.height(row, column)
                            : tiles_.maps().size() > 1 ? tiles.across(square.tile, place.row, place.column).height
                                                       : NONE;
      *next++ = tile.pose.point(place, map.resolution, height);
    }
  }
}

// The motion of the middle sample, and its gradient over the samples beside it.
void ShownPatches::read_motion(ShownPatch& patch, TileReader& tiles) const {
  const PatchSquare& square = patch.square;
  const Tile& tile = tiles.tiles()[square.tile];
  const double row = square.row + square.middle() * square.stride,
               column = square.column + square.middle() * square.stride;
  const double step = square.stride;
  const auto vertical_velocity = [&](double down, double along) {
    const double found = tiles.across(square.tile, row + down, column + along).rise / tiles.ahead();
    return std::isnan(found) ? 0.0 : found;
  };
  const Vec3 at = tile.pose.point({row, column}, tile.grid->resolution);
  const Vec3 slide = tile.pose.slide(at.x, at.y);
  patch.linear = {slide.x, slide.y, vertical_velocity(0.0, 0.0)};
  const double width = 2.0 * step * tile.grid->resolution;
  const double east = (vertical_velocity(0.0, step) - vertical_velocity(0.0, -step)) / width,
               north = (vertical_velocity(step, 0.0) - vertical_velocity(-step, 0.0)) / width;
  const double x = east * tile.pose.cos - north * tile.pose.sin, y = east * tile.pose.sin + north * tile.pose.cos;
  patch.angular = {y, -x, slide.z};
}

// Reads the triangles of meshes in reach; false if there are none.
bool ShownPatches::read_meshes(ShownPatch& patch, double time) {
  const ReachingBody& body = patch.body;
  const Vec3 half{body.radius, body.radius, body.radius};
  Bounds box{body.middle - half, body.middle + half};
  if (body.always) box.low.z = -ANY_HEIGHT, box.high.z = ANY_HEIGHT;
  const Updates now = tiles_.updates_of({}, time);
  const bool same = patch.is_mesh && norm2(patch.box.low - box.low) == 0.0 && norm2(patch.box.high - box.high) == 0.0;
  if (same && patch.calm && patch.updates == now.count) return !patch.triangles.empty();
  tiles_.gather_meshes(box, time, INSTANT, Everything{}, found_);
  if (found_.facets.empty()) return false;
  found_.finish();
  patch.box = box, patch.updates = now.count, patch.calm = !now.moves, patch.read = {};
  ++patch.points_revision;
  patch.points.clear(), patch.triangles.clear();
  std::vector<std::int32_t> place(found_.points.size(), -1);
  std::vector<int> used;
  for (const Facet& facet : found_.facets) {
    std::array<std::int32_t, 3> corners;
    for (int j = 0; j < 3; ++j) {
      std::int32_t& known = place[facet.corner[j]];
      if (known < 0) known = static_cast<std::int32_t>(used.size()), used.push_back(facet.corner[j]);
      corners[j] = known;
    }
    patch.triangles.push_back(corners);
  }
  Vec3 mean;
  for (int k : used) patch.points.push_back(found_.points[k]), mean = mean + found_.points[k] * (1.0 / used.size());
  const auto away = [&](int k) { return std::hypot(found_.points[k].x - mean.x, found_.points[k].y - mean.y); };
  const int middle = *std::min_element(used.begin(), used.end(), [&](int a, int b) { return away(a) < away(b); });
  patch.linear = found_.velocity_at(found_.points[middle]);
  patch.angular = found_.angular_velocity_at(found_.points[middle]);
  patch.tile = static_cast<int>(found_.names[middle] >> NAME_BITS) - 1;
  patch.row = 0, patch.column = static_cast<int>(found_.names[middle] & ((1L << NAME_BITS) - 1));
  return true;
}

// Finds what a circle around the middle of the body meets, seen from above: cells of a map, or triangles of a mesh.
void ShownPatches::find_near(ShownPatch& patch) {
  const PatchSquare& square = patch.square;
  const double radius = patch.body.radius,
               cell = patch.is_mesh ? 1.0 : tiles_.maps()[square.tile]->resolution * square.stride;
  const double row = (patch.place.row - square.row) / square.stride,
               column = (patch.place.column - square.column) / square.stride;
  const auto meets_cell = [&](int first) {
    const double r = first / square.side, c = first % square.side;
    const double down = distance_to(row, r, r + 1.0) * cell, along = distance_to(column, c, c + 1.0) * cell;
    return down * down + along * along <= radius * radius;
  };
  near_.clear();
  for (std::size_t k = 0; k < patch.triangles.size(); ++k) {
    const auto& corners = patch.triangles[k];
    if (patch.is_mesh ? distance2_seen_from_above(patch.body.middle, corners, patch.points) <= radius * radius
                      : meets_cell(corners[0]))
      near_.push_back(static_cast<std::int32_t>(k));
  }
  if (near_ == patch.near && patch.near_of == patch.points_revision) return;
  patch.near.swap(near_);
  patch.near_of = patch.points_revision;
  ++patch.near_revision;
}

}  // namespace smartmesh
