// A vertex of a shape, or the centre of a ball, against facets, edges and peaks.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "contact/cones.h"
#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Returns the time [s] at which a ball that is apart from a line or point touches it, negative if that is not within
// the step. `from` [m]: from a point of the line to the ball's centre; `along`: unit, zero for a point.
double time_of_touch(const MovingPoint& ball, const Vec3& from, const Vec3& along, double duration) {
  const Vec3 w = perpendicular(from, along), v = perpendicular(ball.velocity, along);
  const double vv = norm2(v), vw = dot(v, w), apart = norm2(w) - ball.radius * ball.radius;
  const double root = vw * vw - vv * apart;
  if (!(apart > 0.0 && vw < 0.0 && root >= 0.0)) return -1.0;
  const double time = (-vw - std::sqrt(root)) / vv;
  return time <= duration ? time : -1.0;
}

}  // namespace

void add_contact(const MovingPoint& point, int name, const Vec3& normal, double from_core, int ground,
                 std::vector<Contact>& contacts) {
  const double distance = from_core - point.radius;
  if (distance <= point.contact_distance)
    contacts.push_back({point.at - normal * from_core, normal, distance, name, ground});
}

int ground_name(const Patch& patch, int a, int b, int c) {
  std::uint64_t name = 1469598103934665603ull;
  for (int k : {a, b, c}) name = (name ^ static_cast<std::uint64_t>(k < 0 ? -1 : patch.names[k])) * 1099511628211ull;
  return static_cast<int>(name >> 33);
}

void touch_vertex(const Convex& shape, const Pose& pose, int vertex, const Patch& patch, const Approach& approach,
                  std::vector<Contact>& contacts) {
  const Polytope& core = shape.core;
  const Vec3 at = pose.to_world(core.vertices[vertex]), velocity = approach.velocity_at(at);
  const MovingPoint point{at,
                          velocity,
                          shape.rounding,
                          approach.contact_distance(velocity),
                          pose.to_world(shape.centre),
                          approach.angle_after_impact(unit(-approach.linear))};
  if (at.z - point.radius - point.contact_distance > patch.highest) return;
  const int name = name_of(BodyFeature::Vertex, vertex);
  const auto touch = patch.is_mesh ? touch_sheets : touch_facets;
  if (!touch(point, name, patch, approach.duration, contacts)) return;
  const double most = point.radius + point.contact_distance;
  const auto add = [&](const Vec3& n, double distance, const auto& feature, int one, int other) {
    const double slack = cone_slack(approach, n, distance - point.radius);
    if (!in_cone(patch, feature, n, slack) || !in_cone(core, vertex, transposed(pose.rotation, n), slack)) return false;
    add_contact(point, name, n, distance, ground_name(patch, one, other), contacts);
    return true;
  };
  const auto touches = [&](const Vec3& nearest, const auto& feature, int one, int other) {
    const double distance = norm(at - nearest);
    return distance <= most && distance > 1e-9 && add((at - nearest) * (1.0 / distance), distance, feature, one, other);
  };
  // What a ball only comes to within the step: from `start` along `side`, which is zero for a peak.
  const auto meet = [&](const Vec3& start, const Vec3& side, const auto& feature, int one, int other) {
    if (shape.rounding == 0.0) return;
    const Vec3 along = unit(side);
    const double time = time_of_touch(point, at - start, along, approach.duration);
    const Vec3 then = at + velocity * time - start;
    const double s = dot(then, along), length = norm(side);
    if (time < 0.0 || (length > 0.0 && !(s > 0.0 && s < length))) return;
    const Vec3 n = (then - along * s) * (1.0 / shape.rounding);
    add(n, dot(n, at - start), feature, one, other);
  };
  const PatchCells& cells = patch.cells;
  const CellRange near = cells.near(at.x, at.y, most + ROUNDING, most + ROUNDING);
  for (int r = near.top; r < std::min(near.bottom + 1, cells.rows); ++r) {
    const std::size_t first = cells.at(r, near.left), end = cells.at(r, std::min(near.right, cells.columns - 1)) + 1;
    for (int e = cells.edges[first]; e < cells.edges[end]; ++e) {
      const Edge& edge = patch.edges[e];
      const Vec3 &a = patch.points[edge.end[0]], &b = patch.points[edge.end[1]];
      const double t = along_segment(at, a, b);
      if (!(t > 0.0 && t < 1.0 && touches(a + (b - a) * t, edge, edge.end[0], edge.end[1])))
        meet(a, b - a, edge, edge.end[0], edge.end[1]);
    }
    for (int k = cells.peaks[first]; k < cells.peaks[end]; ++k) {
      const Peak& peak = patch.peaks[k];
      if (!touches(patch.points[peak.point], peak, peak.point, -1))
        meet(patch.points[peak.point], {}, peak, peak.point, -1);
    }
  }
}

}  // namespace smartmesh
