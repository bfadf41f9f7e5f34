// A vertex of a shape, or the centre of a ball, against facets, edges and peaks.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "cones.h"
#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Returns true if the vertical through `p` meets the triangle (a, b, c).
bool is_over(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto left = [&](const Vec3& q, const Vec3& r) {
    return (r.x - q.x) * (p.y - q.y) - (r.y - q.y) * (p.x - q.x) >= 0.0;
  };
  return left(a, b) && left(b, c) && left(c, a);
}

// Deepest facet below which a point lies, and whether the point lies below the ground.
struct Below {
  bool is_below = false;
  int facet = -1;
  double distance = -1e300;

  void add(int candidate, double from_plane) {
    if (from_plane > distance) distance = from_plane, facet = candidate;
  }
};

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

bool touch_facets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  const auto& p = patch.points;
  const std::size_t first = contacts.size();
  Below below;
  for (std::size_t f = 0; f < patch.facets.size(); ++f) {
    const Facet& facet = patch.facets[f];
    const Vec3 &a = p[facet.corner[0]], &b = p[facet.corner[1]], &c = p[facet.corner[2]];
    const double from_plane = dot(facet.normal, point.at - a);
    if (from_plane > point.radius + point.reach) continue;
    if (from_plane < 0.0 && is_over(point.at, a, b, c)) {
      below.is_below = true;
      below.add(static_cast<int>(f), from_plane);
    }
    const Vec3 foot = point.at - facet.normal * from_plane;
    if (inside_triangle(foot, a, b, c, facet.normal, 0.0)) {
      if (from_plane < 0.0) {
        below.add(static_cast<int>(f), from_plane);
        continue;
      }
    } else {  // it may still come to the facet within the step
      const double closing = -dot(facet.normal, point.velocity), gap = from_plane - point.radius;
      if (!(gap >= 0.0 && closing * duration > gap)) continue;
      if (!inside_triangle(foot + (point.velocity + facet.normal * closing) * (gap / closing), a, b, c, facet.normal,
                           point.radius))
        continue;
    }
    add_contact(point, name, facet.normal, from_plane,
                ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2]), contacts);
  }
  if (!below.is_below) return true;
  contacts.resize(first);
  const Facet& facet = patch.facets[below.facet];
  add_contact(point, name, facet.normal, below.distance,
              ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2]), contacts);
  return false;
}

void touch_vertex(const Convex& shape, const Pose& pose, int vertex, const Patch& patch, const Approach& approach,
                  std::vector<Contact>& contacts) {
  const Polytope& core = shape.core;
  const Vec3 at = pose.to_world(core.vertices[vertex]), velocity = approach.velocity_at(at);
  const MovingPoint point{at, velocity, shape.radius, approach.margin + norm(velocity) * approach.duration,
                          pose.to_world(shape.centre)};
  const int name = name_of(BodyFeature::Vertex, vertex);
  if (!touch_facets(point, name, patch, approach.duration, contacts)) return;
  if (!patch.sheets.empty() && !touch_sheets(point, name, patch, approach.duration, contacts)) return;
  const double most = point.radius + point.reach;
  const auto add = [&](const Vec3& foot, int ground, const auto& feature) {
    const Vec3 away = at - foot;
    const double distance = norm(away);
    if (!(distance <= most && distance > 1e-9)) return;
    const Vec3 n = away * (1.0 / distance);
    if (in_cone(patch, feature, n) && in_cone(core, vertex, transposed(pose.turn, n)))
      add_contact(point, name, n, distance, ground, contacts);
  };
  for (const Edge& edge : patch.edges) {
    const Vec3 &a = patch.points[edge.end[0]], &b = patch.points[edge.end[1]];
    const double t = along_segment(at, a, b);
    if (t > 0.0 && t < 1.0) add(a + (b - a) * t, ground_name(patch, edge.end[0], edge.end[1]), edge);
  }
  for (const Peak& peak : patch.peaks) add(patch.points[peak.point], ground_name(patch, peak.point), peak);
}

}  // namespace smartmesh
