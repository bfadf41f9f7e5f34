// Facets of meshes, which are touched from both sides.
//
// The straight way from a shape's centre to a point of the shape lies inside the shape. If the way goes through an odd
// number of facets of a mesh, the point has penetrated the mesh. If the number is even, the way has gone through
// something thin: a ridge beside the point, which does not matter, or a plate that the point is behind. The point
// leaves by the nearest of these facets that leads out, to the side of the centre. So bodies on a table, under it and
// beside it are right without knowing which side of a facet is its outside, or how thick the table is.
#include <algorithm>
#include <cmath>

#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Distance beside a facet at which a point still counts as over the facet, as a share of its distance to the facet: two
// facets whose angle is below the limit of MeshSurface have no edge between them.
constexpr double SLACK = 1e-5;
// Share by which the way from a shape's centre to its point is longer, so that a point on a facet is behind it.
constexpr double TOUCHING = 1e-6;
// Cosine of the angle between two facets up to which what they bound is a plate; at a larger angle it is a ridge.
constexpr double PLATE = 0.7;

// Returns true if the way from `inside` to `at` goes through a facet, at this `share` of the way. A way through the
// common edge of two facets goes through one of them, because both judge the edge by the same numbers.
bool goes_through(const Vec3& inside, const Vec3& at, const Facet& facet, const Patch& patch, double& share) {
  const auto& p = patch.points;
  const auto& k = facet.corner;
  const double from = dot(facet.normal, inside - p[k[0]]), to = dot(facet.normal, at - p[k[0]]);
  if (!(from * to < 0.0)) return false;
  share = from / (from - to);
  const auto passes_left = [&](int i, int j) {
    const bool left = dot(at - inside, cross(p[std::min(i, j)] - inside, p[std::max(i, j)] - inside)) >= 0.0;
    return left == (i < j);
  };
  const bool left = passes_left(k[0], k[1]);
  return passes_left(k[1], k[2]) == left && passes_left(k[2], k[0]) == left;
}

bool is_beside(const Vec3& at, const Facet& facet, const Patch& patch) {
  const auto& p = patch.points;
  const Vec3 &a = p[facet.corner[0]], &b = p[facet.corner[1]], &c = p[facet.corner[2]];
  const double distance = dot(facet.normal, at - a);
  return !inside_triangle(at - facet.normal * distance, a, b, c, facet.normal, SLACK * std::abs(distance));
}

// A facet that the way to a point goes through, at this share of the way, and its mesh.
struct Passage {
  long mesh;
  double share;
  const Facet* facet;
};

// Returns the end of the way from `inside` to `at`.
Vec3 end_of_way(const Vec3& inside, const Vec3& at) { return at + (at - inside) * TOUCHING; }

// Returns the facets that the way from `inside` to `at` goes through, mesh by mesh, in turn.
std::vector<Passage> passages_to(const Vec3& inside, const Vec3& at, const Patch& patch) {
  std::vector<Passage> found;
  double share;
  for (const Facet& facet : patch.facets)
    if (goes_through(inside, end_of_way(inside, at), facet, patch, share))
      found.push_back({patch.mesh_of(facet), share, &facet});
  std::sort(found.begin(), found.end(),
            [](const Passage& a, const Passage& b) { return a.mesh != b.mesh ? a.mesh < b.mesh : a.share < b.share; });
  return found;
}

// Returns true if a point is in a mesh or behind a plate: the `passages` lead from `inside` to it.
bool is_behind(const std::vector<Passage>& passages, const Vec3& inside, const Vec3& at, const Patch& patch) {
  for (std::size_t first = 0, end; first < passages.size(); first = end) {
    for (end = first; end < passages.size() && passages[end].mesh == passages[first].mesh;) ++end;
    if ((end - first) % 2 == 1) return true;
    const Facet &front = *passages[end - 2].facet, &back = *passages[end - 1].facet;
    if (dot(normal_towards(inside, front, patch), normal_towards(inside, back, patch)) > PLATE &&
        !is_beside(at, front, patch))
      return true;
  }
  return false;
}

}  // namespace

Vec3 normal_towards(const Vec3& p, const Facet& facet, const Patch& patch) {
  return dot(facet.normal, p - patch.points[facet.corner[0]]) < 0.0 ? -facet.normal : facet.normal;
}

const Facet* penetrated(const Vec3& inside, const Vec3& at, const Patch& patch) {
  const std::vector<Passage> passages = passages_to(inside, at, patch);
  if (!is_behind(passages, inside, at, patch)) return nullptr;
  const Facet* way_out = nullptr;
  double depth = 1e300;
  bool is_clear = false;
  for (const Passage& passage : passages) {
    const Vec3 n = normal_towards(inside, *passage.facet, patch);
    const double below = -dot(n, at - patch.points[passage.facet->corner[0]]);
    const Vec3 lifted = at + n * (below + SLACK * norm(at - inside));
    const bool clears = !is_behind(passages_to(inside, lifted, patch), inside, lifted, patch);
    if (clears < is_clear || (clears == is_clear && below >= depth)) continue;
    way_out = passage.facet, depth = below, is_clear = clears;
  }
  return way_out;
}

bool touch_sheets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  // The point is lifted out of the facets that it penetrates. Facets that are hidden below them are then not over it.
  MovingPoint lifted = point;
  const Facet* behind[MOST_BEHIND];
  int count = 0;
  const double lift = SLACK * (norm(point.at - point.inside) + point.contact_distance);
  while (count < MOST_BEHIND) {
    const Facet* facet = penetrated(point.inside, lifted.at, patch);
    if (facet == nullptr) break;
    const Vec3 n = normal_towards(point.inside, *facet, patch);
    const double from_plane = dot(n, lifted.at - patch.points[facet->corner[0]]);
    add_contact(lifted, name, n, from_plane, ground_name(patch, *facet), contacts);
    lifted.at = lifted.at + n * (lift - from_plane);
    lifted.velocity = lifted.velocity - n * std::min(0.0, dot(n, lifted.velocity));
    behind[count++] = facet;
  }
  const double most = point.radius + point.contact_distance;
  for (const Facet& facet : patch.facets) {
    if (norm2(lifted.at - patch.points[facet.corner[0]]) > (most + facet.size) * (most + facet.size)) continue;
    const double distance = std::abs(dot(facet.normal, lifted.at - patch.points[facet.corner[0]]));
    if (distance > most || std::find(behind, behind + count, &facet) != behind + count) continue;
    const Vec3 n = normal_towards(end_of_way(point.inside, lifted.at), facet, patch);
    if (comes_over(lifted, n, distance, duration, SLACK, facet, patch))
      add_contact(lifted, name, n, distance, ground_name(patch, facet), contacts);
  }
  return count == 0;
}

}  // namespace smartmesh
