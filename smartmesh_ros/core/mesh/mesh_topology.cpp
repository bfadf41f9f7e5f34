#include "mesh/mesh_topology.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "math/box_tree.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Distance up to which two places are the same, as a share of the size of the mesh. Raising it joins parts that were
// rounded differently, but also parts that are apart.
constexpr double SAME_PLACE = 1e-9;
// Sine of the smallest angle of a facet with an area.
constexpr double FLAT = 1e-9;

// A side of a facet, or a part of it, from the lower to the higher vertex.
struct Side {
  int low, high, opposite, facet;
};

class Builder {
 public:
  Builder(const std::vector<Vec3>& points, MeshTopology& mesh)
      : points_(points), mesh_(mesh), is_corner_(points.size(), false) {
    Bounds bounds;
    for (const Vec3& p : points) bounds.add(p);
    mesh_.tolerance = SAME_PLACE * norm(bounds.high - bounds.low);
  }

  void run(const std::int64_t* triangles, int count) {
    weld();
    for (int k = 0; k < count; ++k) add_facet(triangles + 3 * static_cast<std::size_t>(k));
    divide();
    join();
    find_neighbours();
  }

 private:
  // Gives each vertex the first one at its place.
  void weld() {
    std::vector<Bounds> boxes;
    for (const Vec3& p : points_) boxes.push_back({p, p});
    tree_.build(boxes);
    for (int v = 0; v < static_cast<int>(points_.size()); ++v) {
      int same = v;
      tree_.find(boxes[v].grown(mesh_.tolerance), found_);
      for (int other : found_)
        if (other < same && first_[other] == other && norm(points_[other] - points_[v]) <= mesh_.tolerance)
          same = other;
      first_.push_back(same);
      if (same != v) mesh_.joints.push_back({v, {same, same}});
    }
  }

  void add_facet(const std::int64_t* corners) {
    const int a = first_[corners[0]], b = first_[corners[1]], c = first_[corners[2]];
    const Vec3 u = points_[b] - points_[a], v = points_[c] - points_[a], w = points_[c] - points_[b];
    const double longest2 = std::max({norm2(u), norm2(v), norm2(w)});
    if (!(norm(cross(u, v)) > FLAT * longest2)) return;
    const int facet = static_cast<int>(mesh_.facets.size());
    mesh_.facets.push_back({a, b, c});
    for (int v : {a, b, c}) is_corner_[v] = true;
    for (const auto& [from, to, opposite] : {std::tuple{a, b, c}, std::tuple{b, c, a}, std::tuple{c, a, b}})
      sides_.push_back({std::min(from, to), std::max(from, to), opposite, facet});
  }

  void sort_sides() {
    std::sort(sides_.begin(), sides_.end(), [](const Side& a, const Side& b) {
      return std::tie(a.low, a.high, a.opposite, a.facet) < std::tie(b.low, b.high, b.opposite, b.facet);
    });
  }

  // Divides the sides on which vertices lie.
  void divide() {
    sort_sides();
    std::vector<Side> divided;
    std::vector<std::pair<double, int>> on;
    for (std::size_t k = 0; k < sides_.size(); ++k) {
      const Side side = sides_[k];
      if (k == 0 || side.low != sides_[k - 1].low || side.high != sides_[k - 1].high) find_on(side, on);
      int from = side.low;
      for (const auto& [share, v] : on) {
        divided.push_back({std::min(from, v), std::max(from, v), side.opposite, side.facet});
        from = v;
      }
      divided.push_back({std::min(from, side.high), std::max(from, side.high), side.opposite, side.facet});
    }
    sides_.swap(divided);
  }

  // Finds the vertices on a side, in order.
  void find_on(const Side& side, std::vector<std::pair<double, int>>& on) {
    const Vec3 &a = points_[side.low], &b = points_[side.high];
    Bounds bounds;
    bounds.add(a), bounds.add(b);
    tree_.find(bounds.grown(mesh_.tolerance), found_);
    on.clear();
    for (int v : found_) {
      if (!is_corner_[v] || v == side.low || v == side.high) continue;
      const double share = along_segment(points_[v], a, b);
      if (share > 0.0 && share < 1.0 && norm(a + (b - a) * share - points_[v]) <= mesh_.tolerance) {
        on.push_back({share, v});
        mesh_.joints.push_back({v, {side.low, side.high}});
      }
    }
    std::sort(on.begin(), on.end());
  }

  // Makes edges of the sides that have the same ends.
  void join() {
    sort_sides();
    std::vector<std::pair<int, int>> of_facet;
    for (const Side& side : sides_) {
      if (mesh_.edges.empty() || mesh_.edges.back().end[0] != side.low || mesh_.edges.back().end[1] != side.high)
        mesh_.edges.push_back({{side.low, side.high}, static_cast<int>(mesh_.opposite.size()), 0});
      mesh_.opposite.push_back(side.opposite);
      ++mesh_.edges.back().count;
      of_facet.push_back({side.facet, static_cast<int>(mesh_.edges.size()) - 1});
    }
    fill(of_facet, mesh_.facets.size(), mesh_.edges_of);
  }

  void find_neighbours() {
    std::vector<std::pair<int, int>> pairs;
    const auto add = [&](int a, int b) { pairs.push_back({a, b}), pairs.push_back({b, a}); };
    for (const Side& side : sides_) {
      add(side.low, side.high);
      add(side.low, side.opposite);
      add(side.high, side.opposite);
    }
    fill(pairs, points_.size(), mesh_.neighbours);
  }

  // Makes a list of each vertex or facet `pair.first`, ascending and without repetitions.
  static void fill(const std::vector<std::pair<int, int>>& pairs, std::size_t count, Lists& lists) {
    std::vector<int> start(count + 1, 0), items(pairs.size());
    for (const auto& pair : pairs) ++start[pair.first + 1];
    for (std::size_t k = 0; k < count; ++k) start[k + 1] += start[k];
    std::vector<int> next(start.begin(), start.end() - 1);
    for (const auto& pair : pairs) items[next[pair.first]++] = pair.second;
    lists.start.assign(1, 0);
    for (std::size_t k = 0; k < count; ++k) {
      const auto begin = items.begin() + start[k], end = items.begin() + start[k + 1];
      std::sort(begin, end);
      lists.items.insert(lists.items.end(), begin, std::unique(begin, end));
      lists.start.push_back(static_cast<int>(lists.items.size()));
    }
  }

  const std::vector<Vec3>& points_;
  MeshTopology& mesh_;
  BoxTree tree_;  // of the points
  std::vector<int> first_, found_;
  std::vector<char> is_corner_;
  std::vector<Side> sides_;
};

}  // namespace

MeshTopology topology_of(const std::vector<Vec3>& points, const std::int64_t* triangles, int count) {
  MeshTopology mesh;
  Builder(points, mesh).run(triangles, count);
  return mesh;
}

bool holds_together(const MeshTopology& mesh, const std::vector<Vec3>& points) {
  return std::all_of(mesh.joints.begin(), mesh.joints.end(), [&](const Joint& joint) {
    const Vec3 &p = points[joint.vertex], &a = points[joint.ends[0]], &b = points[joint.ends[1]];
    const double share = along_segment(p, a, b);
    return share >= 0.0 && share <= 1.0 && norm(a + (b - a) * share - p) <= 2.0 * mesh.tolerance;
  });
}

}  // namespace smartmesh
