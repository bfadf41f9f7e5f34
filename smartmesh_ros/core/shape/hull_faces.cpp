// Quickhull: the point farthest outside a face is added, in place of all faces that it sees, until none is outside.
#include <algorithm>
#include <cmath>
#include <map>

#include "shape/convex.h"

namespace smartmesh {

namespace {

struct Face {
  int corner[3];
  int beyond[3] = {-1, -1, -1};  // the face at the other side of the edge from corner k to corner k + 1
  Vec3 normal;
  double offset = 0.0;
  std::vector<int> outside;  // points that no older face has
  bool gone = false;
};

struct HorizonEdge {
  int from, to, beyond;
};

class Quickhull {
 public:
  Quickhull(const std::vector<Vec3>& points, double tolerance) : p_(points), tolerance_(tolerance) {}

  std::vector<std::vector<int>> run() {
    int ends[4];
    const int size = find_ends(ends);
    if (size < 3) return {};
    if (size == 3) return flat_faces(unit(cross(p_[ends[1]] - p_[ends[0]], p_[ends[2]] - p_[ends[0]])));
    start(ends);
    for (std::size_t f = 0; f < faces_.size(); ++f)  // faces that are added come last
      if (!faces_[f].gone && !faces_[f].outside.empty()) add_point(static_cast<int>(f));
    return merged();
  }

 private:
  double above(const Face& face, int k) const { return dot(face.normal, p_[k]) - face.offset; }

  // Returns the point with the largest value, -1 if none is above the tolerance.
  template <class Value>
  int farthest(Value value) const {
    int best = -1;
    double most = tolerance_;
    for (int k = 0; k < static_cast<int>(p_.size()); ++k) {
      const double size = value(p_[k]);
      if (size > most) most = size, best = k;
    }
    return best;
  }

  // Finds two points far apart, one far from their line, and one far from the plane of the three; returns how many.
  int find_ends(int ends[4]) const {
    ends[0] = farthest([&](const Vec3& q) { return norm(q - p_[0]); });
    if (ends[0] < 0) return 1;
    const Vec3 a = p_[ends[0]];
    ends[1] = farthest([&](const Vec3& q) { return norm(q - a); });
    const Vec3 along = unit(p_[ends[1]] - a);
    ends[2] = farthest([&](const Vec3& q) { return norm(cross(along, q - a)); });
    if (ends[2] < 0) return 2;
    const Vec3 normal = unit(cross(along, p_[ends[2]] - a));
    ends[3] = farthest([&](const Vec3& q) { return std::abs(dot(normal, q - a)); });
    if (ends[3] < 0) return 3;
    if (dot(normal, p_[ends[3]] - a) > 0.0) std::swap(ends[1], ends[2]);  // the first three are seen from outside
    return 4;
  }

  int add_face(int a, int b, int c) {
    Face face{{a, b, c}, {-1, -1, -1}, unit(cross(p_[b] - p_[a], p_[c] - p_[a])), 0.0, {}, false};
    face.offset = dot(face.normal, p_[a]);
    faces_.push_back(face);
    return static_cast<int>(faces_.size()) - 1;
  }

  void start(const int e[4]) {
    add_face(e[0], e[1], e[2]), add_face(e[0], e[3], e[1]), add_face(e[1], e[3], e[2]), add_face(e[2], e[3], e[0]);
    const int beyond[4][3] = {{1, 2, 3}, {3, 2, 0}, {1, 3, 0}, {2, 1, 0}};
    for (int f = 0; f < 4; ++f) std::copy(beyond[f], beyond[f] + 3, faces_[f].beyond);
    std::vector<int> all(p_.size());
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = static_cast<int>(k);
    share_out(all, 0);
  }

  // Gives points to the first face from `first` on that they are outside of.
  void share_out(const std::vector<int>& points, std::size_t first) {
    for (int k : points) {
      for (std::size_t f = first; f < faces_.size(); ++f) {
        if (above(faces_[f], k) <= tolerance_) continue;
        faces_[f].outside.push_back(k);
        break;
      }
    }
  }

  void add_point(int f) {
    const auto lower = [&](int a, int b) { return above(faces_[f], a) < above(faces_[f], b); };
    const int eye = *std::max_element(faces_[f].outside.begin(), faces_[f].outside.end(), lower);
    std::vector<HorizonEdge> horizon;
    std::vector<int> orphans;
    remove_seen(f, 0, eye, 3, horizon, orphans);
    const int first = static_cast<int>(faces_.size()), count = static_cast<int>(horizon.size());
    for (int k = 0; k < count; ++k) {
      const HorizonEdge& edge = horizon[k];
      const int added = add_face(edge.from, edge.to, eye);
      faces_[added].beyond[0] = edge.beyond;
      faces_[added].beyond[1] = first + (k + 1) % count;
      faces_[added].beyond[2] = first + (k + count - 1) % count;
      Face& other = faces_[edge.beyond];
      for (int side = 0; side < 3; ++side)
        if (other.corner[side] == edge.to && other.corner[(side + 1) % 3] == edge.from) other.beyond[side] = added;
    }
    share_out(orphans, static_cast<std::size_t>(first));
  }

  // Removes the faces that a point sees, from face `f` on over `sides` of its edges from `side` on. The edges around
  // them come out in order.
  void remove_seen(int f, int side, int eye, int sides, std::vector<HorizonEdge>& horizon, std::vector<int>& orphans) {
    faces_[f].gone = true;
    for (int k : faces_[f].outside)
      if (k != eye) orphans.push_back(k);
    for (int k = 0; k < sides; ++k) {
      const int edge = (side + k) % 3, other = faces_[f].beyond[edge];
      if (faces_[other].gone) continue;
      const int from = faces_[f].corner[edge], to = faces_[f].corner[(edge + 1) % 3];
      if (above(faces_[other], eye) <= 0.0) {
        horizon.push_back({from, to, other});
        continue;
      }
      int back = 0;
      while (faces_[other].corner[back] != to) ++back;
      remove_seen(other, (back + 1) % 3, eye, 2, horizon, orphans);
    }
  }

  // Returns the loops of the faces, those of one plane in one, the largest triangle of a plane telling its normal.
  std::vector<std::vector<int>> merged() const {
    std::vector<int> order, group(faces_.size(), -1);
    for (std::size_t f = 0; f < faces_.size(); ++f)
      if (!faces_[f].gone) order.push_back(static_cast<int>(f));
    const auto size = [&](int f) {
      const int* c = faces_[f].corner;
      return norm2(cross(p_[c[1]] - p_[c[0]], p_[c[2]] - p_[c[0]]));
    };
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return size(a) > size(b); });
    std::vector<std::vector<int>> loops;
    for (int seed : order) {
      if (group[seed] >= 0) continue;
      std::vector<int> members{seed};
      group[seed] = seed;
      for (std::size_t k = 0; k < members.size(); ++k) {
        for (int other : faces_[members[k]].beyond) {
          const auto is_off = [&](int c) { return std::abs(above(faces_[seed], c)) > tolerance_; };
          if (group[other] >= 0 || std::any_of(faces_[other].corner, faces_[other].corner + 3, is_off)) continue;
          if (dot(faces_[seed].normal, faces_[other].normal) <= 0.0) continue;
          group[other] = seed;
          members.push_back(other);
        }
      }
      add_loops(members, group, loops);
    }
    return loops;
  }

  // Adds the loop around the members of a group; the members themselves if they have more than one edge around them.
  void add_loops(const std::vector<int>& members, const std::vector<int>& group,
                 std::vector<std::vector<int>>& loops) const {
    std::map<int, int> next;
    std::size_t sides = 0;
    for (int f : members) {
      for (int k = 0; k < 3; ++k) {
        if (group[faces_[f].beyond[k]] == group[f]) continue;
        next[faces_[f].corner[k]] = faces_[f].corner[(k + 1) % 3];
        ++sides;
      }
    }
    std::vector<int> loop{next.begin()->first};
    while (loop.size() <= sides && next[loop.back()] != loop[0]) loop.push_back(next[loop.back()]);
    if (loop.size() == sides) {
      loops.push_back(loop);
      return;
    }
    for (int f : members) loops.push_back({faces_[f].corner, faces_[f].corner + 3});
  }

  // Returns both sides of points of a plane.
  std::vector<std::vector<int>> flat_faces(const Vec3& normal) const {
    std::vector<int> loop{
        farthest_along(std::abs(normal.x) < 0.6 ? cross(normal, {1.0, 0.0, 0.0}) : cross(normal, {0.0, 1.0, 0.0}))};
    while (loop.size() <= p_.size()) {  // the next corner is the one that all others are to the left of
      int next = -1;
      for (int k = 0; k < static_cast<int>(p_.size()); ++k) {
        const Vec3 v = p_[k] - p_[loop.back()];
        if (norm(v) <= tolerance_) continue;
        const Vec3 w = next < 0 ? v : p_[next] - p_[loop.back()];
        const double side = dot(normal, cross(w, v)) / norm(w);
        if (next < 0 || side < -tolerance_ || (side <= tolerance_ && norm2(v) > norm2(w))) next = k;
      }
      if (next < 0 || norm(p_[next] - p_[loop[0]]) <= tolerance_) break;
      loop.push_back(next);
    }
    return {loop, {loop.rbegin(), loop.rend()}};
  }

  int farthest_along(const Vec3& way) const {
    const auto lower = [&](const Vec3& a, const Vec3& b) { return dot(way, a) < dot(way, b); };
    return static_cast<int>(std::max_element(p_.begin(), p_.end(), lower) - p_.begin());
  }

  const std::vector<Vec3>& p_;
  double tolerance_;
  std::vector<Face> faces_;
};

}  // namespace

std::vector<std::vector<int>> hull_faces(const std::vector<Vec3>& points, double tolerance) {
  return Quickhull(points, tolerance).run();
}

}  // namespace smartmesh
