// An edge of a polytope against the convex edges of the ground.
#include <algorithm>
#include <cmath>

#include "cones.h"
#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Distance outside a face at which a point still counts as inside the shape [m], against rounding.
constexpr double BESIDE = 1e-9;

// Returns a direction from an edge of the ground outwards: for meshes into the shape, which a segment does not tell but
// by the way `away` to it.
Vec3 outward_of(const Edge& ground, const PolyEdge& edge, const Pose& pose, const Vec3& away) {
  if (!ground.is_of_mesh()) return ground.outward;
  return edge.faces[0] < 0 ? away : pose.turn * (edge.into[0] + edge.into[1]);
}

// Returns true if a point of an edge of a mesh, `q` (in the shape's frame), lies outside the shape: the edge has then not
// penetrated the shape.
bool is_outside(const Polytope& core, const Vec3& q) {
  return std::any_of(core.faces.begin(), core.faces.end(),
                     [&](const PolyFace& face) { return dot(face.normal, q) > face.offset + BESIDE; });
}

}  // namespace

void touch_edge(const Convex& shape, const Pose& pose, int index, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts) {
  if (patch.edges.empty()) return;
  const PolyEdge& edge = shape.core.edges[index];
  const Vec3 a = pose.to_world(shape.core.vertices[edge.end[0]]), b = pose.to_world(shape.core.vertices[edge.end[1]]);
  const Vec3 middle = (a + b) * 0.5, velocity = approach.velocity_at(middle);
  const double spin = norm(approach.angular) * 0.5 * norm(b - a);
  const double reach = approach.margin + (norm(velocity) + spin) * approach.duration, most = shape.radius + reach;
  Bounds bounds;
  bounds.add(a), bounds.add(b);
  bounds = bounds.grown(most);
  for (const Edge& other : patch.edges) {
    const Vec3 &p = patch.points[other.end[0]], &q = patch.points[other.end[1]];
    if (!bounds.meets({{std::fmin(p.x, q.x), std::fmin(p.y, q.y), -1e300},
                       {std::fmax(p.x, q.x), std::fmax(p.y, q.y), std::fmax(p.z, q.z)}}))
      continue;
    double s, t;
    if (!nearest_on_lines(a, b, p, q, s, t) || !(s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0)) continue;
    Vec3 n = unit(cross(b - a, q - p));
    if (dot(n, outward_of(other, edge, pose, a + (b - a) * s - (p + (q - p) * t))) < 0.0) n = -n;
    const Vec3 on_ground = p + (q - p) * t;
    const double distance = dot(n, a + (b - a) * s - on_ground) - shape.radius;
    if (!(distance <= reach) || !in_cone(patch, other, n) || !in_cone(edge, transposed(pose.turn, n))) continue;
    if (other.is_of_mesh() && distance < -shape.radius && is_outside(shape.core, pose.to_local(on_ground))) continue;
    contacts.push_back({on_ground, n, distance, name_of(BodyFeature::Edge, index),
                        ground_name(patch, other.end[0], other.end[1])});
  }
}

}  // namespace smartmesh
