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
  Builder(const std::vector<Vec3>& points, MeshTopology& mesh) : points_(points), mesh_(mesh) {
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
  // Gives each vertex the first one at its place, by cells of space much larger than the tolerance.
  void weld() {
    const double cell = std::max(1e3 * mesh_.tolerance, 1e-300);
    using Key = std::array<std::int64_t, 3>;
    struct Hash {
      std::size_t operator()(const Key& k) const {
        return static_cast<std::size_t>(k[0]) * 73856093u ^ static_cast<std::size_t>(k[1]) * 19349663u ^
               static_cast<std::size_t>(k[2]) * 83492791u;
      }
    };
    std::unordered_map<Key, int, Hash> last;  // vertex in a cell; `before` leads from it to the others
    std::vector<int> before(points_.size(), -1);
    last.reserve(points_.size());
    const auto place = [&](double x, int side) {
      return static_cast<std::int64_t>(std::floor((x + side * mesh_.tolerance) / cell));
    };
    first_.resize(points_.size());
    for (int v = 0; v < static_cast<int>(points_.size()); ++v) {
      const Vec3& p = points_[v];
      int same = v;
      for (std::int64_t x = place(p.x, -1); x <= place(p.x, 1); ++x)
        for (std::int64_t y = place(p.y, -1); y <= place(p.y, 1); ++y)
          for (std::int64_t z = place(p.z, -1); z <= place(p.z, 1); ++z) {
            const auto found = last.find({x, y, z});
            for (int other = found == last.end() ? -1 : found->second; other >= 0; other = before[other])
              if (norm(points_[other] - p) <= mesh_.tolerance) same = std::min(same, other);
          }
      first_[v] = same;
      if (same == v) {
        const auto [cell_of_v, is_new] = last.try_emplace({place(p.x, 0), place(p.y, 0), place(p.z, 0)}, v);
        if (!is_new) before[v] = cell_of_v->second, cell_of_v->second = v;
      } else {
        mesh_.joints.push_back({v, {same, same}});
      }
    }
  }

  void add_facet(const std::int64_t* corners) {
    const int a = first_[corners[0]], b = first_[corners[1]], c = first_[corners[2]];
    const Vec3 u = points_[b] - points_[a], v = points_[c] - points_[a], w = points_[c] - points_[b];
    const double longest2 = std::max({norm2(u), norm2(v), norm2(w)});
    if (!(norm(cross(u, v)) > FLAT * longest2)) return;
    const int facet = static_cast<int>(mesh_.facets.size());
    mesh_.facets.push_back({a, b, c});
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
    std::vector<int> corners;
    for (const auto& facet : mesh_.facets) corners.insert(corners.end(), facet.begin(), facet.end());
    std::sort(corners.begin(), corners.end());
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    std::vector<Bounds> boxes;
    for (int v : corners) boxes.push_back({points_[v], points_[v]});
    BoxTree tree;
    tree.build(boxes);
    sort_sides();
    std::vector<Side> divided;
    std::vector<int> found;
    std::vector<std::pair<double, int>> on;
    for (std::size_t k = 0; k < sides_.size(); ++k) {
      const Side side = sides_[k];
      if (k == 0 || side.low != sides_[k - 1].low || side.high != sides_[k - 1].high)
        find_on(side, corners, tree, found, on);
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
  void find_on(const Side& side, const std::vector<int>& corners, const BoxTree& tree, std::vector<int>& found,
               std::vector<std::pair<double, int>>& on) {
    const Vec3 &a = points_[side.low], &b = points_[side.high];
    Bounds bounds;
    bounds.add(a), bounds.add(b);
    tree.find(bounds.grown(mesh_.tolerance), found);
    on.clear();
    for (int k : found) {
      const int v = corners[k];
      if (v == side.low || v == side.high) continue;
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
  std::vector<int> first_;
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
