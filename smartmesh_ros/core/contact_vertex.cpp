// A vertex of a shape, or the centre of a ball, against facets, edges and peaks.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "cones.h"
#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Added to distances in which features are looked for, against rounding [m].
constexpr double ROUNDING = 1e-6;

void add_contact(const MovingPoint& point, int name, const Vec3& normal, double from_core, int ground,
                 std::vector<Contact>& contacts) {
  const double distance = from_core - point.radius;
  if (distance <= point.reach) contacts.push_back({point.at - normal * from_core, normal, distance, name, ground});
}

}  // namespace

int ground_name(const Patch& patch, int a, int b, int c) {
  std::uint64_t name = 1469598103934665603ull;
  for (int k : {a, b, c}) name = (name ^ static_cast<std::uint64_t>(k < 0 ? -1 : patch.names[k])) * 1099511628211ull;
  return static_cast<int>(name >> 33);
}

int way_out(const Vec3& point, const Patch& patch, double& distance) {
  const auto& p = patch.points;
  const PatchCells& cells = patch.cells;
  int facet = -1;
  const auto look = [&](double half, bool only_over) {
    const CellRange near = cells.near(point.x, point.y, half, half);
    for (int r = near.top; r < near.bottom; ++r) {
      for (int f = cells.facets[cells.at(r, near.left)]; f < cells.facets[cells.at(r, near.right - 1) + 1]; ++f) {
        const Facet& it = patch.facets[f];
        const Vec3 &a = p[it.corner[0]], &b = p[it.corner[1]], &c = p[it.corner[2]];
        const double from_plane = dot(it.normal, point - a);
        if (!(from_plane < 0.0 && from_plane > distance)) continue;
        if (!is_over(point, a, b, c) &&
            (only_over || !inside_triangle(point - it.normal * from_plane, a, b, c, it.normal, 0.0)))
          continue;
        distance = from_plane;
        facet = f;
      }
    }
  };
  distance = -1e300;
  look(ROUNDING, true);
  if (facet >= 0) look(-distance + ROUNDING, false);
  return facet;
}

bool touch_facets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  const auto& p = patch.points;
  const std::size_t first = contacts.size();
  bool is_below = false;
  const double most = point.radius + point.reach;
  const auto touch = [&](const Facet& facet) {
    const Vec3 &a = p[facet.corner[0]], &b = p[facet.corner[1]], &c = p[facet.corner[2]];
    const double from_plane = dot(facet.normal, point.at - a);
    if (from_plane > most) return;
    if (from_plane < 0.0) {
      is_below |= is_over(point.at, a, b, c);
      return;
    }
    const Vec3 foot = point.at - facet.normal * from_plane;
    if (!inside_triangle(foot, a, b, c, facet.normal, 0.0)) {  // it may still come to the facet within the step
      const double closing = -dot(facet.normal, point.velocity), gap = from_plane - point.radius;
      if (!(gap >= 0.0 && closing * duration > gap)) return;
      if (!inside_triangle(foot + (point.velocity + facet.normal * closing) * (gap / closing), a, b, c, facet.normal,
                           point.radius))
        return;
    }
    add_contact(point, name, facet.normal, from_plane,
                ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2]), contacts);
  };
  const PatchCells& cells = patch.cells;
  const double half = most + point.radius + ROUNDING;  // what it may come to lies up to a radius beside its way
  const CellRange near = cells.near(point.at.x, point.at.y, half, half);
  for (int r = near.top; r < near.bottom; ++r)
    for (int f = cells.facets[cells.at(r, near.left)]; f < cells.facets[cells.at(r, near.right - 1) + 1]; ++f)
      touch(patch.facets[f]);
  if (!is_below) return true;
  contacts.resize(first);
  double distance;
  const Facet& facet = patch.facets[way_out(point.at, patch, distance)];
  add_contact(point, name, facet.normal, distance,
              ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2]), contacts);
  return false;
}

void touch_vertex(const Convex& shape, const Pose& pose, int vertex, const Patch& patch, const Approach& approach,
                  std::vector<Contact>& contacts) {
  const Polytope& core = shape.core;
  const Vec3 at = pose.to_world(core.vertices[vertex]), velocity = approach.velocity_at(at);
  const MovingPoint point{at, velocity, shape.radius, approach.margin + norm(velocity) * approach.duration};
  if (at.z - point.radius - point.reach > patch.highest) return;
  const int name = name_of(BodyFeature::Vertex, vertex);
  if (!touch_facets(point, name, patch, approach.duration, contacts)) return;
  const double most = point.radius + point.reach;
  const auto add = [&](const Vec3& foot, const auto& feature, int one, int other) {
    const Vec3 away = at - foot;
    const double distance = norm(away);
    if (!(distance <= most && distance > 1e-9)) return;
    const Vec3 n = away * (1.0 / distance);
    if (in_cone(patch, feature, n) && in_cone(core, vertex, transposed(pose.turn, n)))
      add_contact(point, name, n, distance, ground_name(patch, one, other), contacts);
  };
  const PatchCells& cells = patch.cells;
  const CellRange near = cells.near(at.x, at.y, most + ROUNDING, most + ROUNDING);
  for (int r = near.top; r < std::min(near.bottom + 1, cells.rows); ++r) {
    const std::size_t first = cells.at(r, near.left), end = cells.at(r, std::min(near.right, cells.columns - 1)) + 1;
    for (int e = cells.edges[first]; e < cells.edges[end]; ++e) {
      const Edge& edge = patch.edges[e];
      const Vec3 &a = patch.points[edge.end[0]], &b = patch.points[edge.end[1]];
      const double t = along_segment(at, a, b);
      if (t > 0.0 && t < 1.0) add(a + (b - a) * t, edge, edge.end[0], edge.end[1]);
    }
    for (int k = cells.peaks[first]; k < cells.peaks[end]; ++k)
      add(patch.points[patch.peaks[k].point], patch.peaks[k], patch.peaks[k].point, -1);
  }
}

}  // namespace smartmesh
