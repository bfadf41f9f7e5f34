#include "surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Distance outside a map at which a point still counts as on its edge [samples].
constexpr double EDGE = 1e-6;
// Share of a cell by which a gap between tiles may be wider than a cell, against rounding.
constexpr double GAP_ROUNDING = 1e-6;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

// Returns how far a point lies outside a grid [samples], along the axis where it is farthest.
double beyond(const HeightGrid& grid, const GridPoint& p) {
  return std::max({-p.row, -p.column, p.row - (grid.rows - 1), p.column - (grid.columns - 1), 0.0});
}

}  // namespace

GroundPoint grid_ground(const HeightGrid& grid, GridPoint place, double time, double ahead) {
  const double row = std::clamp(place.row, 0.0, grid.rows - 1.0);
  const double column = std::clamp(place.column, 0.0, grid.columns - 1.0);
  const int r = std::min(static_cast<int>(row), grid.rows - 2), c = std::min(static_cast<int>(column), grid.columns - 2);
  const double v = row - r, u = column - c;
  const bool upper = u < v;
  GridReader reader(grid, time, ahead);
  const struct {
    double weight;
    int row, column;
  } corners[3] = {{1.0 - std::max(u, v), r, c},
                  {std::abs(u - v), upper ? r + 1 : r, upper ? c : c + 1},
                  {std::min(u, v), r + 1, c + 1}};
  GroundPoint ground{0.0, 0.0};
  for (const auto& corner : corners) {
    if (corner.weight == 0.0) continue;
    const Sample sample = reader.read(corner.row, corner.column);
    ground.height += corner.weight * sample.height;
    ground.velocity += corner.weight * sample.rise / ahead;
  }
  return ground;
}

GroundPoint Surface::at(double x, double y, double time, double ahead, double z) const {
  const GroundPoint tile = tiles_at(x, y, time, ahead);
  const MeshPoint mesh = meshes_at(x, y, z, time, ahead);
  return mesh.height <= tile.height || std::isnan(mesh.height) ? tile : GroundPoint{mesh.height, mesh.velocity.z};
}

MeshPoint Surface::meshes_at(double x, double y, double z, double time, double ahead) const {
  MeshPoint highest{NONE, {}, {}};
  for (const MeshSurface* mesh : meshes_) {
    const MeshPoint ground = mesh->below(x, y, z, time, ahead);
    if (!(ground.height <= highest.height) && !std::isnan(ground.height)) highest = ground;
  }
  return highest;
}

GroundPoint Surface::tiles_at(double x, double y, double time, double ahead) const {
  for (const HeightGrid* grid : tiles_) {
    const GridPoint place = to_grid(grid->pose_at(time), grid->resolution, x, y);
    if (!(beyond(*grid, place) <= EDGE)) continue;  // also if it is so far away that it is no number
    const GroundPoint ground = grid_ground(*grid, place, time, ahead);
    if (!std::isnan(ground.height)) return ground;
  }
  return tiles_.size() > 1 ? bridged(x, y, time, ahead) : GroundPoint{NONE, 0.0};
}

GroundPoint Surface::bridged(double x, double y, double time, double ahead) const {
  const double widest = widest_cell() * (1.0 + GAP_ROUNDING);
  double weights = 0.0;
  GroundPoint sum{0.0, 0.0};
  int sides = 0;
  for (const HeightGrid* grid : tiles_) {
    const GridPoint place = to_grid(grid->pose_at(time), grid->resolution, x, y);
    const double distance = beyond(*grid, place) * grid->resolution;
    if (!(distance > 0.0 && distance <= widest)) continue;
    const GroundPoint edge = grid_ground(*grid, place, time, ahead);
    if (std::isnan(edge.height)) continue;
    weights += 1.0 / distance;
    sum.height += edge.height / distance;
    sum.velocity += edge.velocity / distance;
    ++sides;
  }
  if (sides < 2) return {NONE, 0.0};
  return {sum.height / weights, sum.velocity / weights};
}

double Surface::widest_cell() const {
  double widest = 0.0;
  for (const HeightGrid* grid : tiles_) widest = std::max(widest, grid->resolution);
  return widest;
}

Bounds Surface::with_gaps(const Bounds& bounds) const {
  return tiles_.size() > 1 ? bounds.grown(widest_cell()) : bounds;
}

void Surface::set_tiles(const std::vector<const HeightGrid*>& tiles, const std::vector<const MeshSurface*>& meshes) {
  tiles_ = tiles;
  meshes_ = meshes;
  ++layout_;
}

long Surface::revision() const {
  long sum = layout_;
  for (const HeightGrid* grid : tiles_) sum += grid->revision;
  for (const MeshSurface* mesh : meshes_) sum += mesh->revision;
  return sum;
}

bool Surface::moves(double time) const {
  return std::any_of(tiles_.begin(), tiles_.end(), [&](const HeightGrid* grid) { return grid->moves(time); }) ||
         std::any_of(meshes_.begin(), meshes_.end(), [&](const MeshSurface* mesh) { return mesh->moves(time); });
}

void Surface::heights_under(const Bounds& bounds, double time, std::vector<double>& heights) {
  heights.clear();
  const Bounds grown = with_gaps(bounds);
  for (const HeightGrid* grid : tiles_) {
    const CellRange cells = cells_under(grid->pose_at(time), grid->resolution, grid->rows, grid->columns, grown);
    if (cells.empty()) continue;
    read_window(*grid, cells, time, window_);
    for (double height : window_.heights) heights.push_back(std::isnan(height) ? 1e300 : height);
  }
  Patch near;
  gather_meshes(bounds, time, Everything{}, near);
  for (const Vec3& p : near.points) heights.insert(heights.end(), {p.x, p.y, p.z});
}

void Surface::gather_meshes(const Bounds& bounds, double time, const Reach& reach, Patch& patch) {
  patch.clear();
  patch.is_mesh = true;
  for (std::size_t k = 0; k < meshes_.size(); ++k)
    meshes_[k]->gather(bounds, time, reach, static_cast<int>(k), scratch_, patch);
}

double Surface::highest_under(const Bounds& bounds, double time) {
  if (!meshes_.empty()) return 1e300;  // not worth a search of its own
  double highest = -1e300;
  const Bounds grown = with_gaps(bounds);
  for (const HeightGrid* grid : tiles_) {
    const CellRange cells = cells_under(grid->pose_at(time), grid->resolution, grid->rows, grid->columns, grown);
    if (cells.empty()) continue;
    read_window(*grid, cells, time, window_);
    highest = std::max(highest, window_.highest());
  }
  return highest;
}

void Surface::gather(const Bounds& bounds, double time, const Reach& reach, Patch& patch) {
  patch.clear();
  const HeightGrid* finest = nullptr;
  int met = 0;
  const Bounds grown = with_gaps(bounds);
  for (const HeightGrid* grid : tiles_) {
    if (cells_under(grid->pose_at(time), grid->resolution, grid->rows, grid->columns, grown).empty()) continue;
    ++met;
    if (finest == nullptr || grid->resolution < finest->resolution) finest = grid;
  }
  if (met == 0) return;
  if (met > 1) {
    sample_across(*finest, bounds, time);
    add_cells(window_, 0, 0, reach, patch);
    return;
  }
  const CellRange cells = cells_under(finest->pose_at(time), finest->resolution, finest->rows, finest->columns, bounds);
  if (cells.empty()) return;
  read_window(*finest, cells, time, window_);
  if (window_.highest() >= bounds.low.z) add_cells(window_, cells.top - 1, cells.left - 1, reach, patch);
}

// Samples all tiles on the lattice of the finest one, which may go on beyond its edge.
void Surface::sample_across(const HeightGrid& finest, const Bounds& bounds, double time) {
  GridPose pose = finest.pose_at(time);
  double low_row = 1e300, high_row = -1e300, low_column = 1e300, high_column = -1e300;
  for (int corner = 0; corner < 4; ++corner) {
    const GridPoint p = to_grid(pose, finest.resolution, corner & 1 ? bounds.high.x : bounds.low.x,
                                corner & 2 ? bounds.high.y : bounds.low.y);
    low_row = std::min(low_row, p.row), high_row = std::max(high_row, p.row);
    low_column = std::min(low_column, p.column), high_column = std::max(high_column, p.column);
  }
  const double top = std::floor(low_row) - 1.0, left = std::floor(low_column) - 1.0;
  window_.rows = static_cast<int>(std::ceil(high_row) - top) + 2;
  window_.columns = static_cast<int>(std::ceil(high_column) - left) + 2;
  window_.resolution = finest.resolution;
  const double u = left * finest.resolution, v = top * finest.resolution;
  pose.x += u * pose.cos - v * pose.sin;
  pose.y += u * pose.sin + v * pose.cos;
  window_.pose = pose;
  window_.heights.resize(static_cast<std::size_t>(window_.rows) * window_.columns);
  for (int r = 0; r < window_.rows; ++r) {
    for (int c = 0; c < window_.columns; ++c) {
      const Vec3 p = window_.point(r, c);
      window_.at(r, c) = tiles_at(p.x, p.y, time, INSTANT).height;
    }
  }
}

GroundMotion Surface::motion_at(double x, double y, double half, double time, double ahead, double z) const {
  const GroundPoint here = tiles_at(x, y, time, ahead);
  const MeshPoint mesh = meshes_at(x, y, z, time, ahead);
  GroundMotion motion;
  if (!(mesh.height <= here.height) && !std::isnan(mesh.height))
    return {true, {x, y, mesh.height}, mesh.velocity, mesh.turn};
  if (std::isnan(here.height)) return motion;
  motion.known = true;
  motion.foot = {x, y, here.height};
  motion.linear = {0.0, 0.0, here.velocity};
  const auto slope = [&](double dx, double dy) {
    const GroundPoint low = tiles_at(x - dx, y - dy, time, ahead), high = tiles_at(x + dx, y + dy, time, ahead);
    if (std::isnan(low.height) || std::isnan(high.height)) return 0.0;
    return (high.velocity - low.velocity) / (2.0 * half);
  };
  motion.angular = {slope(0.0, half), -slope(half, 0.0), 0.0};
  for (const HeightGrid* grid : tiles_) {
    const GridPose pose = grid->pose_at(time);
    const GridPoint place = to_grid(pose, grid->resolution, x, y);
    if (beyond(*grid, place) > 1.0) continue;
    motion.linear.x = pose.slide_x - pose.spin * (y - pose.y);
    motion.linear.y = pose.slide_y + pose.spin * (x - pose.x);
    motion.angular.z = pose.spin;
    break;
  }
  return motion;
}

}  // namespace smartmesh
