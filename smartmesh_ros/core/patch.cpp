#include "patch.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Fall of the ground beside an edge or a peak from which on it counts as convex [m]. Less is rounding of heights.
constexpr double CONVEX = 1e-7;

// Steps in rows and columns to the neighbours of a sample, in a circle. Cells are cut from (r, c) to (r + 1, c + 1).
constexpr int AROUND[6][2] = {{0, 1}, {1, 1}, {1, 0}, {0, -1}, {-1, -1}, {-1, 0}};

// Adds the parts of one window to a patch.
class CellAdder {
 public:
  CellAdder(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch)
      : window_(window), first_row_(first_row), first_column_(first_column), reach_(reach), patch_(patch), index_(patch.index), active_(patch.active) {
    const std::size_t count = window.heights.size();
    patch.index.assign(count, -1);
    patch.active.assign(count, 0);
  }

  void run() {
    for (int r = 1; r < window_.rows - 2; ++r)
      for (int c = 1; c < window_.columns - 2; ++c) active_[at(r, c)] = in_reach(r, c);
    PatchCells& cells = patch_.cells;
    cells.pose = window_.pose, cells.resolution = window_.resolution;
    cells.rows = window_.rows, cells.columns = window_.columns;
    for (auto* starts : {&cells.facets, &cells.edges, &cells.peaks}) starts->clear();
    for (int r = 0; r < window_.rows; ++r) {
      for (int c = 0; c < window_.columns; ++c) {
        cells.facets.push_back(static_cast<int>(patch_.facets.size()));
        if (active_[at(r, c)]) add_facets(r, c);
      }
    }
    cells.facets.push_back(static_cast<int>(patch_.facets.size()));
    patch_.steepest = 1.0;
    // Edges and peaks belong to the cells at all their sides.
    for (int r = 0; r < window_.rows; ++r) {
      for (int c = 0; c < window_.columns; ++c) {
        cells.edges.push_back(static_cast<int>(patch_.edges.size()));
        cells.peaks.push_back(static_cast<int>(patch_.peaks.size()));
        if (r < 1 || c < 1 || r >= window_.rows - 1 || c >= window_.columns - 1) continue;
        const bool here = active_[at(r, c)], below = active_[at(r - 1, c)], left = active_[at(r, c - 1)];
        if (here || below) add_edge(r, c, r, c + 1, r + 1, c + 1, r - 1, c);
        if (here || left) add_edge(r, c, r + 1, c, r, c - 1, r + 1, c + 1);
        if (here) add_edge(r, c, r + 1, c + 1, r + 1, c, r, c + 1);
        if (here || below || left || active_[at(r - 1, c - 1)]) add_peak(r, c);
      }
    }
    cells.edges.push_back(static_cast<int>(patch_.edges.size()));
    cells.peaks.push_back(static_cast<int>(patch_.peaks.size()));
  }

 private:
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * window_.columns + column; }
  bool inside(int row, int column) const {
    return row >= 0 && column >= 0 && row < window_.rows && column < window_.columns;
  }
  double height(int row, int column) const { return inside(row, column) ? window_.at(row, column) : NAN; }

  bool in_reach(int r, int c) const {
    const double a = window_.at(r, c), b = window_.at(r, c + 1), d = window_.at(r + 1, c), e = window_.at(r + 1, c + 1);
    double low = 1e300, high = -1e300;
    for (double z : {a, b, d, e})
      if (!std::isnan(z)) low = std::min(low, z), high = std::max(high, z);
    if (high < low) return false;
    const double size = window_.resolution, half = 0.5 * (high - low);
    const double u = (c + 0.5) * size, v = (r + 0.5) * size;
    const GridPose& pose = window_.pose;
    const Vec3 centre{pose.x + u * pose.cos - v * pose.sin, pose.y + u * pose.sin + v * pose.cos, low + half};
    return reach_.touches(centre, std::sqrt(0.5 * size * size + half * half));
  }

  // Returns the index of a sample in the patch, -1 for a hole.
  int point(int row, int column) {
    if (!inside(row, column)) return -1;
    int& known = index_[at(row, column)];
    if (known < 0 && !std::isnan(window_.at(row, column))) {
      known = static_cast<int>(patch_.points.size());
      patch_.points.push_back(window_.point(row, column));
      patch_.names.push_back(((first_row_ + row) << 24) + first_column_ + column);
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

  Vec3 beside(const Vec3& normal) {
    patch_.steepest = std::min(patch_.steepest, normal.z);
    return normal;
  }

  void add_facets(int r, int c) {
    const int a = point(r, c), b = point(r, c + 1), d = point(r + 1, c), e = point(r + 1, c + 1);
    add_facet(a, b, e);
    add_facet(a, e, d);
  }

  // Adds the edge from sample (r, c) to (r2, c2) if the ground is convex there. Its facets have their third corners at
  // (left_r, left_c), to the left of the edge, and at (right_r, right_c).
  void add_edge(int r, int c, int r2, int c2, int left_r, int left_c, int right_r, int right_c) {
    const double za = height(r, c), zb = height(r2, c2);
    if (std::isnan(za + zb)) return;
    const double zl = height(left_r, left_c), zr = height(right_r, right_c);
    const bool left = !std::isnan(zl), right = !std::isnan(zr);
    // The four corners are a parallelogram seen from above.
    if (!(left || right) || (left && right && !(zl + zr < za + zb - CONVEX))) return;
    const int a = point(r, c), b = point(r2, c2);
    const int l = left ? point(left_r, left_c) : -1, t = right ? point(right_r, right_c) : -1;
    Vec3 outward;
    if (left) outward = outward + beside(normal_of(a, b, l));
    if (right) outward = outward + beside(normal_of(b, a, t));
    if (!(left && right)) patch_.steepest = -1.0;
    patch_.edges.push_back({{a, b}, {l, t}, outward});
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
  if (cells.rows != 0) return;
  cells.rows = cells.columns = 1;
  cells.facets = {0, static_cast<int>(facets.size())};
  cells.edges = {0, static_cast<int>(edges.size())};
  cells.peaks = {0, static_cast<int>(peaks.size())};
}

void add_cells(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch) {
  CellAdder(window, first_row, first_column, reach, patch).run();
}

}  // namespace smartmesh
