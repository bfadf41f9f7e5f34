// An edge of a polytope against the convex edges of the ground.
#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/cones.h"
#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Depth up to which overlaps are found, as a share of the bounding radius.
constexpr double DEEP = 0.05;

// Returns a direction from the ground's edge into the shape. Meshes may be touched from both sides: there the shape
// tells, or, of a segment, the way `away` to it.
Vec3 outward_of(const Patch& patch, const Edge& ground, const PolyEdge& edge, const Pose& pose, const Vec3& away) {
  if (!patch.is_mesh) return ground.outward;
  return edge.faces[0] < 0 ? away : pose.rotation * (edge.into[0] + edge.into[1]);
}

// Returns the normal of a pair of edges, that of the face or facet beside them if `n` lies beyond it, and what it turns
// with.
std::pair<Vec3, NormalOf> seated(const Polytope& core, const PolyEdge& edge, const Pose& pose, const Patch& patch,
                                 const Edge& ground, const Vec3& n) {
  const Vec3 local = transposed(pose.rotation, n);
  for (int k = 0; k < 2; ++k)
    if (edge.faces[k] >= 0 && dot(local, edge.into[k]) < 0.0)
      return {pose.rotation * -core.faces[edge.faces[k]].normal, NormalOf::Body};
  const Vec3 &a = patch.points[ground.end[0]], &b = patch.points[ground.end[1]];
  for (int k : ground.opposite) {
    if (k < 0 || !(dot(n, patch.points[k] - a) > 0.0)) continue;
    const Vec3 normal = unit(cross(b - a, patch.points[k] - a));
    return {dot(normal, n) < 0.0 ? -normal : normal, NormalOf::Ground};
  }
  return {n, NormalOf::Edges};
}

}  // namespace

bool is_shortest(const Convex& shape, const Pose& pose, const Patch& patch, const Edge& edge, double t, const Vec3& n,
                 double distance) {
  const double limit = MUCH_SHORTER * distance;
  const Vec3 &a = patch.points[edge.end[0]], &b = patch.points[edge.end[1]];
  Vec3 corners[4] = {pose.to_local(a), pose.to_local(b)};
  if (!is_passed(shape, corners[0], corners[1])) return false;
  int count = 2;
  for (int k : edge.opposite) {
    if (k < 0) continue;
    Vec3 normal = unit(cross(b - a, patch.points[k] - a));
    const bool is_rim = patch.is_mesh && edge.opposite[1] < 0;  // of a sheet, which the shape leaves to its own side
    if (dot(normal, is_rim ? pose.to_world(shape.centre) - a : edge.outward) < 0.0) normal = -normal;
    if (lowest(shape, transposed(pose.rotation, normal)) + dot(normal, pose.at - a) > limit) return false;
    corners[count++] = pose.to_local(patch.points[k]);
  }
  const auto is_touched_instead = [&](const Peak& peak) {
    return peak.point == edge.end[t > 0.5] && in_cone(patch, peak, n, SEAT);
  };
  if (!(t > 0.0 && t < 1.0) && std::any_of(patch.peaks.begin(), patch.peaks.end(), is_touched_instead)) return false;
  const auto leaves = [&](const Vec3& normal, double offset) {
    double least = 1e300;
    for (int k = 0; k < count; ++k) least = std::min(least, dot(normal, corners[k]) - offset);
    return least > limit;
  };
  if (shape.kind == ShapeKind::Cylinder) {
    Vec3 radial = corners[0] + (corners[1] - corners[0]) * std::clamp(t, 0.0, 1.0);
    radial.z = 0.0;
    return !leaves({0.0, 0.0, 1.0}, shape.half.z) && !leaves({0.0, 0.0, -1.0}, shape.half.z) &&
           !leaves(unit(radial), shape.half.x);
  }
  return std::none_of(shape.core.faces.begin(), shape.core.faces.end(),
                      [&](const PolyFace& face) { return leaves(face.normal, face.offset + shape.rounding); });
}

void touch_edge(const Convex& shape, const Pose& pose, int index, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts) {
  if (patch.edges.empty()) return;
  const PolyEdge& edge = shape.core.edges[index];
  const Vec3 a = pose.to_world(shape.core.vertices[edge.end[0]]), b = pose.to_world(shape.core.vertices[edge.end[1]]);
  const Vec3 middle = (a + b) * 0.5, velocity = approach.velocity_at(middle);
  const double spin = norm(approach.angular) * 0.5 * norm(b - a);
  const double contact_distance = approach.contact_distance(norm(velocity) + spin),
               most = shape.rounding + contact_distance;
  if (std::min(a.z, b.z) - most > patch.highest) return;
  Bounds bounds;
  bounds.add(a), bounds.add(b);
  const double across =
      std::sqrt(1.0 - std::pow(std::max(patch.steepest, 0.0), 2));  // horizontal part of the steepest normal
  bounds = bounds.grown(std::max(most, DEEP * shape.bounding_radius * across));
  const PatchCells& cells = patch.cells;
  const CellRange near = cells.near(middle.x, middle.y, middle.x - bounds.low.x, middle.y - bounds.low.y);
  const auto touch = [&](const Edge& other) {
    const Vec3 &p = patch.points[other.end[0]], &q = patch.points[other.end[1]];
    if (!bounds.meets({{std::min(p.x, q.x), std::min(p.y, q.y), -1e300},
                       {std::max(p.x, q.x), std::max(p.y, q.y), std::max(p.z, q.z)}}))
      return;
    double s, t;
    if (!nearest_on_lines(a, b, p, q, s, t) || !(s > 0.0 && s < 1.0)) return;
    const Vec3 on_ground = p + (q - p) * std::clamp(t, 0.0, 1.0), on_edge = a + (b - a) * s;
    Vec3 n = unit(cross(b - a, q - p));
    if (dot(n, outward_of(patch, other, edge, pose, on_edge - on_ground)) < 0.0) n = -n;
    const double from_edge = dot(n, on_edge - on_ground), distance = from_edge - shape.rounding;
    if (!(distance <= contact_distance) || !is_on_edge(t, from_edge)) return;
    const double slack = cone_slack(approach, n, distance, SEAT);
    if (!in_cone(edge, transposed(pose.rotation, n), slack) || !in_cone(patch, other, n, slack)) return;
    if (from_edge < 0.0 && !is_shortest(shape, pose, patch, other, t, n, distance)) return;
    const auto [normal, normal_of] = seated(shape.core, edge, pose, patch, other, n);
    if (!(dot(normal, n) > 0.0)) return;  // the edge is so sharp that it seems to lie in its cone either way
    contacts.push_back({on_ground, normal, dot(normal, on_edge - on_ground) - shape.rounding,
                        name_of(BodyFeature::Edge, index), ground_name(patch, other.end[0], other.end[1])});
    contacts.back().normal_of = normal_of;
    contacts.back().body_edge = unit(b - a), contacts.back().ground_edge = unit(q - p);
    contacts.back().ground_turn = patch.turn_of(other);
  };
  for (int r = near.top; r < std::min(near.bottom + 1, cells.rows); ++r) {
    const int end = cells.edges[cells.at(r, std::min(near.right, cells.columns - 1)) + 1];
    for (int e = cells.edges[cells.at(r, near.left)]; e < end; ++e) touch(patch.edges[e]);
  }
}

}  // namespace smartmesh
