// The cells of a window that may be touched, as parts of a patch.
#include <algorithm>
#include <cmath>

#include "mesh/patch.h"

namespace smartmesh {

namespace {

// Fall of the ground beside an edge or a peak from which on it counts as convex [m]. Less is rounding of heights.
constexpr double CONVEX = 1e-7;

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
      : window_(window),
        first_row_(first_row),
        first_column_(first_column),
        reach_(reach),
        patch_(patch),
        index_(patch.index),
        active_(patch.active) {
    const std::size_t count = window.heights.size();
    bottom_ = reach.bottom(), depth_ = reach.depth();
    has_walls_ = bottom_ < 1e300 &&
                 std::any_of(window.heights.begin(), window.heights.end(), [](double z) { return std::isnan(z); });
    patch.index.assign(has_walls_ ? 2 * count : count, -1);
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
    cells.pose =
        window_.pose.from({static_cast<double>(range.top), static_cast<double>(range.left)}, window_.resolution);
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
        if (!(active_[at(r, c)] || active_[at(r - 1, c)] || active_[at(r, c - 1)] || active_[at(r - 1, c - 1)]))
          continue;
        add_peak(r, c);
        if (has_walls_) add_wall_corners(r, c);
      }
    }
    cells.facets.push_back(static_cast<int>(patch_.facets.size()));
    cells.edges.push_back(static_cast<int>(patch_.edges.size()));
    cells.peaks.push_back(static_cast<int>(patch_.peaks.size()));
  }

 private:
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * window_.columns + column; }
  double height(int row, int column) const { return window_.at(row, column); }

  // Finds the cells that may be touched, and the rectangle that holds them.
  void find_active() {
    active_cells_ = {window_.rows, window_.columns, 0, 0};
    for (int r = 1; r < window_.rows - 2; ++r) {
      for (int c = 1; c < window_.columns - 2; ++c) {
        if (!in_reach(r, c)) continue;
        active_[at(r, c)] = 1;
        CellRange& found = active_cells_;
        found = {std::min(found.top, r), std::min(found.left, c), std::max(found.bottom, r + 1),
                 std::max(found.right, c + 1)};
      }
    }
  }

  bool in_reach(int r, int c) const {
    const double a = window_.at(r, c), b = window_.at(r, c + 1), d = window_.at(r + 1, c), e = window_.at(r + 1, c + 1);
    double low = 1e300, high = -1e300;
    for (double z : {a, b, d, e})
      if (!std::isnan(z)) low = std::min(low, z), high = std::max(high, z);
    if (high < low) return false;
    const bool has_walls = has_walls_ && is_at_rim(r, c);
    if (has_walls) low = std::min(low, foot_of(low));
    const double size = window_.resolution, half = 0.5 * (high - low);
    const double across = 0.5 * size * (std::abs(window_.pose.cos) + std::abs(window_.pose.sin));
    const Vec3 centre = window_.pose.point({r + 0.5, c + 0.5}, size, low + half), extent{across, across, half};
    if (!has_walls && reach_.is_clear_of({centre - extent, centre + extent})) return false;
    return reach_.touches(centre, std::sqrt(0.5 * size * size + half * half));
  }

  // Returns the index of a sample in the patch, -1 for a hole. Samples around active cells are inside the window.
  int point(int row, int column) {
    int& known = index_[at(row, column)];
    if (known < 0 && !std::isnan(window_.at(row, column))) {
      known = static_cast<int>(patch_.points.size());
      patch_.points.push_back(window_.point(row, column));
      if (window_.moves()) patch_.velocities.push_back(window_.velocity(row, column));
      patch_.names.push_back((first_row_ + row) * COLUMNS_NAMED + first_column_ + column);
    }
    return known;
  }

  bool is_at_rim(int r, int c) const {
    for (int row = r - 1; row <= r + 2; ++row)
      for (int column = c - 1; column <= c + 2; ++column)
        if (std::isnan(height(row, column))) return true;
    return false;
  }

  // Returns the height of the foot of the wall under a sample at a height [m].
  double foot_of(double z) const { return std::max(bottom_, z - depth_); }

  // Returns the index of the point at the foot of the wall under a sample, -1 if there is none in reach.
  int foot(int row, int column) {
    const int top = has_walls_ ? point(row, column) : -1;
    if (top < 0 || !(patch_.points[top].z > foot_of(patch_.points[top].z))) return -1;
    int& known = index_[window_.heights.size() + at(row, column)];
    if (known < 0) {
      known = static_cast<int>(patch_.points.size());
      const Vec3 above = patch_.points[top];
      patch_.points.push_back({above.x, above.y, foot_of(above.z)});
      if (window_.moves()) patch_.velocities.push_back(Vec3{patch_.velocities[top]});
      patch_.names.push_back(-1 - patch_.names[top]);
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
    if (!has_walls_) return;
    const auto wall = [&](int row, int column, int row2, int column2, double beyond) {
      if (std::isnan(beyond)) add_wall(row, column, row2, column2);
    };
    if (a >= 0 && b >= 0 && e >= 0) {
      wall(r, c, r, c + 1, height(r - 1, c));
      wall(r, c + 1, r + 1, c + 1, height(r + 1, c + 2));
      wall(r + 1, c + 1, r, c, height(r + 1, c));
    }
    if (a >= 0 && e >= 0 && d >= 0) {
      wall(r, c, r + 1, c + 1, height(r, c + 1));
      wall(r + 1, c + 1, r + 1, c, height(r + 2, c + 1));
      wall(r + 1, c, r, c, height(r, c - 1));
    }
  }

  // Adds the wall under an edge that has ground to its left alone.
  void add_wall(int row, int column, int row2, int column2) {
    const int a = point(row, column), b = point(row2, column2), under_a = foot(row, column),
              under_b = foot(row2, column2);
    add_facet(a, under_a, b);
    add_facet(under_a < 0 ? a : under_a, under_b, b);
  }

  // Adds the vertical edges at a sample where two walls meet and the ground is convex.
  void add_wall_corners(int r, int c) {
    constexpr int DEGREES[6] = {0, 45, 90, 180, 225, 270};
    if (std::isnan(height(r, c))) return;
    const auto has = [&](int k) { return !std::isnan(height(r + AROUND[k % 6][0], c + AROUND[k % 6][1])); };
    for (int first = 0; first < 6; ++first) {  // of a gap between facets, seen counterclockwise
      if (!has(first) || !has(first + 5) || has(first + 1)) continue;
      int last = first + 2;
      while (!(has(last) && has(last + 1))) ++last;
      if ((DEGREES[last % 6] - DEGREES[first] + 360) % 360 <= 180) continue;
      const int under = foot(r, c);
      if (under < 0) continue;
      Edge edge{{point(r, c), under}, {-1, -1}, {}};
      const int ends[2] = {first, last % 6};
      for (int k = 0; k < 2; ++k) {
        edge.opposite[k] = point(r + AROUND[ends[k]][0], c + AROUND[ends[k]][1]);
        edge.outward = edge.outward + normal_of(edge.end[1 - k], edge.end[k], edge.opposite[k]);
      }
      patch_.steepest = std::min(patch_.steepest, 0.0);
      patch_.edges.push_back(edge);
    }
  }

  // Adds an edge that starts at sample (r, c) if it belongs to a cell that may be touched, may be touched itself, and
  // the ground is convex there.
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
    Bounds box;
    for (int k : edge.end) box.add(patch_.points[k]);
    if (reach_.is_clear_of(box)) return;
    for (int k = 0; k < 2; ++k) {
      const Side& side = kind.sides[k];
      const bool is_rim = std::isnan(third(side));
      int& corner = edge.opposite[k] = is_rim ? foot(r, c) : point(r + side.row, c + side.column);
      if (is_rim && corner < 0) corner = foot(r2, c2);  // the wall begins where the edge comes into reach
      if (corner < 0) patch_.steepest = -1.0;
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
    const Vec3& p = patch_.points[point(r, c)];
    if (reach_.is_clear_of({p, p})) return;
    double around[6], neighbours[6];  // NaN: they share no facet
    for (int k = 0; k < 6; ++k) around[k] = height(r + AROUND[k][0], c + AROUND[k][1]);
    for (int k = 0; k < 6; ++k)
      neighbours[k] = std::isnan(around[(k + 1) % 6]) && std::isnan(around[(k + 5) % 6]) ? NONE : around[k];
    bool convex = false;
    for (int k = 0; k < 3; ++k) {
      const double pair = neighbours[k] + neighbours[k + 3];
      if (pair > 2.0 * z + CONVEX) return;
      convex |= !(pair >= 2.0 * z - CONVEX);  // a missing neighbour makes an edge of the ground
    }
    if (!convex) return;
    Peak peak{point(r, c), static_cast<int>(patch_.neighbours.size()), 0};
    for (int k = 0; k < 6; ++k) {
      if (std::isnan(neighbours[k])) continue;
      patch_.neighbours.push_back(point(r + AROUND[k][0], c + AROUND[k][1])), ++peak.count;
    }
    if (peak.count == 0) return;
    if (const int under = peak.count < 6 ? foot(r, c) : -1; under >= 0)
      patch_.neighbours.push_back(under), ++peak.count;
    patch_.peaks.push_back(peak);
  }

  const Window& window_;
  const long first_row_, first_column_;
  const Reach& reach_;
  Patch& patch_;
  std::vector<int>& index_;
  std::vector<char>& active_;
  CellRange active_cells_;
  double bottom_, depth_;  // of walls [m]
  bool has_walls_;
};

}  // namespace

void add_cells(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch) {
  CellAdder(window, first_row, first_column, reach, patch).run();
}

}  // namespace smartmesh
