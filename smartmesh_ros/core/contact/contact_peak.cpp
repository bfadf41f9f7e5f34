// A peak of the ground against faces and edges of a polytope.
#include <algorithm>

#include "contact/cones.h"
#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Returns true if `q`, a point of the plane of a face, lies inside the face.
bool inside_face(const Polytope& core, const PolyFace& face, const Vec3& q) {
  for (int k = 0; k < face.count; ++k) {
    const Vec3& a = core.vertices[core.loops[face.first + k]];
    const Vec3& b = core.vertices[core.loops[face.first + (k + 1) % face.count]];
    if (dot(cross(b - a, q - a), face.normal) < 0.0) return false;
  }
  return true;
}

}  // namespace

void touch_peak(const Convex& shape, const Pose& pose, const Peak& peak, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts) {
  const Polytope& core = shape.core;
  const Vec3 at = patch.points[peak.point], velocity = approach.velocity_at(at);
  const double contact_distance = approach.contact_distance(velocity);
  const Vec3 q = pose.to_local(at), moved = transposed(pose.rotation, velocity) * -approach.duration;
  if (!shape.bounds.grown(contact_distance).meets({q, q})) return;
  const int ground = ground_name(patch, peak.point);
  const auto add = [&](const Vec3& n_world, double distance, int name, NormalOf kind = NormalOf::Body) {
    if (distance > contact_distance) return;
    contacts.push_back({at, n_world, distance, name, ground});
    contacts.back().normal_of = kind;
  };
  bool inside = !core.faces.empty();
  for (const PolyFace& face : core.faces) {
    const double from_plane = dot(face.normal, q) - face.offset;
    if (from_plane - shape.rounding > contact_distance) return;  // a plane holds both apart
    inside &= from_plane <= 0.0;
  }
  int way = -1;  // out of the shape: the nearest face that the ground can touch
  double depth = -1e300, least = -1e300;
  for (std::size_t f = 0; f < core.faces.size(); ++f) {
    const PolyFace& face = core.faces[f];
    const double from_plane = dot(face.normal, q) - face.offset;
    if (inside != (from_plane <= 0.0)) continue;
    if (inside) least = std::max(least, from_plane);
    const Vec3 n = pose.rotation * -face.normal;
    if ((inside && from_plane <= depth) || !in_cone(patch, peak, n, cone_slack(approach, n, from_plane, SEAT)))
      continue;
    if (inside) {
      way = static_cast<int>(f), depth = from_plane;
      continue;
    }
    const double closing = -dot(face.normal, moved), gap = std::max(from_plane - shape.rounding, 0.0);
    const bool comes =
        closing > gap &&
        inside_face(core, face, q - face.normal * from_plane + (moved + face.normal * closing) * (gap / closing));
    if (comes || inside_face(core, face, q - face.normal * from_plane))
      add(n, from_plane - shape.rounding, name_of(BodyFeature::Face, static_cast<int>(f)));
  }
  if (inside) {
    if (way >= 0 && least - shape.rounding <= MUCH_SHORTER * (depth - shape.rounding))
      add(pose.rotation * -core.faces[way].normal, depth - shape.rounding, name_of(BodyFeature::Face, way));
    return;
  }
  for (std::size_t k = 0; k < core.edges.size(); ++k) {
    const PolyEdge& edge = core.edges[k];
    const Vec3 &a = core.vertices[edge.end[0]], &b = core.vertices[edge.end[1]];
    const double t = along_segment(q, a, b);
    if (!(t > 0.0 && t < 1.0)) continue;
    const Vec3 away = a + (b - a) * t - q;
    const double distance = norm(away);
    if (!(distance - shape.rounding <= contact_distance && distance > 1e-9)) continue;
    const Vec3 n = away * (1.0 / distance), n_world = pose.rotation * n;
    const double slack = cone_slack(approach, n_world, distance - shape.rounding);
    if (in_cone(edge, n, slack) && in_cone(patch, peak, n_world, slack))
      add(n_world, distance - shape.rounding, name_of(BodyFeature::Edge, static_cast<int>(k)), NormalOf::Ground);
  }
}

}  // namespace smartmesh
