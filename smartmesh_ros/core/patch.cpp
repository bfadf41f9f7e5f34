#include "patch.h"

#include <algorithm>
#include <cmath>

#include "triangle.h"

namespace smartmesh {

namespace {

// Fall of the ground beside an edge or a peak from which on it counts as convex [m]. Less is rounding of heights.
constexpr double CONVEX = 1e-7;

// Distance from a facet within which a point lies on it [m].
constexpr double NEAR = 1e-6;

// More columns than a map has; names of samples are numbered row by row.
constexpr long COLUMNS_NAMED = 1L << 24;

// Steps in rows and columns to the neighbours of a sample, in a circle. Cells are cut from (r, c) to (r + 1, c + 1).
constexpr int AROUND[6][2] = {{0, 1}, {1, 1}, {1, 0}, {0, -1}, {-1, -1}, {-1, 0}};

// Facet beside an edge: its third corner and its cell, relative to the start of the edge.
struct Side {
  int row, column, cell_row, cell_column;
};

// The edges that start at a sample: where they end, and the facets to their left and right.
struct EdgeKind {
  int row, column;
  Side sides[2];
};
constexpr EdgeKind EDGES[3] = {{0, 1, {{1, 1, 0, 0}, {-1, 0, -1, 0}}},
                               {1, 0, {{0, -1, 0, -1}, {1, 1, 0, 0}}},
                               {1, 1, {{1, 0, 0, 0}, {0, 1, 0, 0}}}};

// Adds the parts of one window to a patch.
class CellAdder {
 public:
  CellAdder(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch)
      : window_(window), first_row_(first_row), first_column_(first_column), reach_(reach), patch_(patch),
        index_(patch.index), active_(patch.active) {
    const std::size_t count = window.heights.size();
    patch.index.assign(count, -1);
    patch.active.assign(count, 0);
  }

  void run() {
    find_active();
    PatchCells& cells = patch_.cells;
    cells.resolution = window_.resolution;
    for (auto* starts : {&cells.facets, &cells.edges, &cells.peaks}) starts->clear();
    cells.rows = cells.columns = 0;
    if (active_cells_.empty()) return;
    // Edges and peaks belong to the cells at all their sides.
    const CellRange range{active_cells_.top, active_cells_.left, active_cells_.bottom + 1, active_cells_.right + 1};
    cells.rows = range.bottom - range.top, cells.columns = range.right - range.left;
    cells.pose = window_.pose.from({static_cast<double>(range.top), static_cast<double>(range.left)}, window_.resolution);
    patch_.steepest = 1.0;
    for (int r = range.top; r < range.bottom; ++r) {
      for (int c = range.left; c < range.right; ++c) {
        cells.facets.push_back(static_cast<int>(patch_.facets.size()));
        if (active_[at(r, c)]) add_facets(r, c);
      }
    }
    for (int r = range.top; r < range.bottom; ++r) {
      for (int c = range.left; c < range.right; ++c) {
        cells.edges.push_back(static_cast<int>(patch_.edges.size()));
        cells.peaks.push_back(static_cast<int>(patch_.peaks.size()));
        for (const EdgeKind& kind : EDGES) add_edge(r, c, kind);
        if (active_[at(r, c)] || active_[at(r - 1, c)] || active_[at(r, c - 1)] || active_[at(r - 1, c - 1)]) add_peak(r, c);
      }
    }
    cells.facets.push_back(static_cast<int>(patch_.facets.size()));
    cells.edges.push_back(static_cast<int>(patch_.edges.size()));
    cells.peaks.push_back(static_cast<int>(patch_.peaks.size()));
  }

 private:
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * window_.columns + column; }
  bool inside(int row, int column) const {
    return row >= 0 && column >= 0 && row < window_.rows && column < window_.columns;
  }
  double height(int row, int column) const { return inside(row, column) ? window_.at(row, column) : NAN; }

  // Finds the cells that may be touched, and the rectangle that holds them.
  void find_active() {
    active_cells_ = {window_.rows, window_.columns, 0, 0};
    for (int r = 1; r < window_.rows - 2; ++r) {
      for (int c = 1; c < window_.columns - 2; ++c) {
        if (!in_reach(r, c)) continue;
        active_[at(r, c)] = 1;
        CellRange& found = active_cells_;
        found = {std::min(found.top, r), std::min(found.left, c), std::max(found.bottom, r + 1), std::max(found.right, c + 1)};
      }
    }
  }

  bool in_reach(int r, int c) const {
    const double a = window_.at(r, c), b = window_.at(r, c + 1), d = window_.at(r + 1, c), e = window_.at(r + 1, c + 1);
    double low = 1e300, high = -1e300;
    for (double z : {a, b, d, e})
      if (!std::isnan(z)) low = std::min(low, z), high = std::max(high, z);
    if (high < low) return false;
    const double size = window_.resolution, half = 0.5 * (high - low);
    const Vec3 centre = window_.pose.point({r + 0.5, c + 0.5}, size, low + half);
    if (!reach_.touches(centre, std::sqrt(0.5 * size * size + half * half))) return false;
    return !reach_.is_clear_of({window_.point(r, c), window_.point(r, c + 1), window_.point(r + 1, c), window_.point(r + 1, c + 1)});
  }

  // Returns the index of a sample in the patch, -1 for a hole.
  int point(int row, int column) {
    if (!inside(row, column)) return -1;
    int& known = index_[at(row, column)];
    if (known < 0 && !std::isnan(window_.at(row, column))) {
      known = static_cast<int>(patch_.points.size());
      patch_.points.push_back(window_.point(row, column));
      if (window_.moves()) patch_.velocities.push_back(window_.velocity(row, column));
      patch_.names.push_back((first_row_ + row) * COLUMNS_NAMED + first_column_ + column);
    }
    return known;
  }

  void add_facet(int a, int b, int c) {
    if (a < 0 || b < 0 || c < 0) return;
    patch_.facets.push_back({{a, b, c}, normal_of(a, b, c)});
  }

  Vec3 normal_of(int a, int b, int c) const {
    const auto& p = patch_.points;
    return unit(cross(p[b] - p[a], p[c] - p[a]));
  }

  void add_facets(int r, int c) {
    const int a = point(r, c), b = point(r, c + 1), d = point(r + 1, c), e = point(r + 1, c + 1);
    add_facet(a, b, e);
    add_facet(a, e, d);
  }

  // Adds an edge that starts at sample (r, c) if it belongs to a cell that may be touched and the ground is convex there.
  void add_edge(int r, int c, const EdgeKind& kind) {
    const auto cell = [&](const Side& side) { return at(r + side.cell_row, c + side.cell_column); };
    const auto third = [&](const Side& side) { return height(r + side.row, c + side.column); };
    const auto& [left, right] = kind.sides;
    if (!active_[cell(left)] && !active_[cell(right)]) return;
    const int r2 = r + kind.row, c2 = c + kind.column;
    const double ends = height(r, c) + height(r2, c2), thirds = third(left) + third(right);
    if (std::isnan(ends)) return;
    // The four corners are a parallelogram seen from above.
    if (std::isnan(thirds) ? std::isnan(third(left)) && std::isnan(third(right)) : !(thirds < ends - CONVEX)) return;
    Edge edge{{point(r, c), point(r2, c2)}, {-1, -1}, {}};
    if (std::isnan(thirds)) patch_.steepest = -1.0;
    for (int k = 0; k < 2; ++k) {
      const Side& side = kind.sides[k];
      const int corner = edge.opposite[k] = point(r + side.row, c + side.column);
      if (corner < 0) continue;
      const Vec3 normal = normal_of(edge.end[k], edge.end[1 - k], corner);
      patch_.steepest = std::min(patch_.steepest, normal.z);
      edge.outward = edge.outward + normal;
    }
    patch_.edges.push_back(edge);
  }

  void add_peak(int r, int c) {
    const double z = height(r, c);
    if (std::isnan(z)) return;
    bool convex = false;
    for (int k = 0; k < 3; ++k) {
      const double pair = height(r + AROUND[k][0], c + AROUND[k][1]) + height(r - AROUND[k][0], c - AROUND[k][1]);
      if (pair > 2.0 * z + CONVEX) return;
      convex |= !(pair >= 2.0 * z - CONVEX);  // a missing neighbour makes an edge of the ground
    }
    if (!convex) return;
    Peak peak{point(r, c), static_cast<int>(patch_.neighbours.size()), 0};
    for (const auto& step : AROUND) {
      const int other = point(r + step[0], c + step[1]);
      if (other >= 0) patch_.neighbours.push_back(other), ++peak.count;
    }
    if (peak.count > 0) patch_.peaks.push_back(peak);
  }

  const Window& window_;
  const long first_row_, first_column_;
  const Reach& reach_;
  Patch& patch_;
  std::vector<int>& index_;
  std::vector<char>& active_;
  CellRange active_cells_;
};

}  // namespace

CellRange PatchCells::near(double x, double y, double half_x, double half_y) const {
  if (rows == 1 && columns == 1) return {0, 0, 1, 1};
  const GridPoint p = to_grid(pose, resolution, x, y);
  const double c = std::abs(pose.cos), s = std::abs(pose.sin), size = 1.0 / resolution;
  const double high = (half_y * c + half_x * s) * size, wide = (half_x * c + half_y * s) * size;
  const auto cell = [](double value, int count) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(count)));
  };
  return {cell(p.row - high, rows), cell(p.column - wide, columns), std::min(cell(p.row + high, rows) + 1, rows),
          std::min(cell(p.column + wide, columns) + 1, columns)};
}

void Patch::finish() {
  highest = -1e300;
  for (const Vec3& p : points) highest = std::max(highest, p.z);
  if (std::none_of(velocities.begin(), velocities.end(), [](const Vec3& v) { return norm2(v) > 0.0; })) velocities.clear();
  if (cells.rows != 0) return;
  cells.rows = cells.columns = 1;
  cells.facets = {0, static_cast<int>(facets.size())};
  cells.edges = {0, static_cast<int>(edges.size())};
  cells.peaks = {0, static_cast<int>(peaks.size())};
}

GroundMotion Patch::motion_at(const Vec3& p) const {
  if (velocities.empty()) return {};
  const Facet* nearest = nullptr;
  Vec3 velocity;
  double least = 1e300, weights[3];
  const auto look = [&](int first, int end) {
    for (int f = first; f < end; ++f) {
      const auto& [k, normal, size] = facets[f];
      const double from_plane = dot(normal, p - points[k[0]]);
      if (from_plane * from_plane >= least) continue;
      const double distance2 = nearest_weights(p, points[k[0]], points[k[1]], points[k[2]], normal, weights);
      if (distance2 >= least) continue;
      least = distance2, nearest = &facets[f];
      velocity = velocities[k[0]] * weights[0] + velocities[k[1]] * weights[1] + velocities[k[2]] * weights[2];
    }
  };
  const CellRange here = cells.near(p.x, p.y, 0.0, 0.0);
  if (!here.empty()) look(cells.facets[cells.at(here.top, here.left)], cells.facets[cells.at(here.top, here.left) + 1]);
  if (least > NEAR * NEAR) look(0, static_cast<int>(facets.size()));
  return {velocity, nearest == nullptr ? Vec3{} : turning(*nearest)};
}

Vec3 Patch::turning(const Facet& facet) const {
  const auto& k = facet.corner;
  const Vec3 u = points[k[1]] - points[k[0]], v = points[k[2]] - points[k[0]];
  const Vec3 du = velocities[k[1]] - velocities[k[0]], dv = velocities[k[2]] - velocities[k[0]];
  const double length = norm(u);
  const Vec3 along = u * (1.0 / length), across = cross(facet.normal, along);
  const double spin = dot(du, across) / length, pitch = -dot(du, facet.normal) / length;
  const double roll = (dot(dv, facet.normal) + dot(v, along) * pitch) / dot(v, across);
  return along * roll + across * pitch + facet.normal * spin;
}

void add_cells(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch) {
  CellAdder(window, first_row, first_column, reach, patch).run();
}

}  // namespace smartmesh
