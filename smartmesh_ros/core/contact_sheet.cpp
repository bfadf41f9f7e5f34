// Facets of meshes, which are touched from both sides.
//
// A shape is at that side of a facet where it reaches the facet from its inside: its point has gone through the facet if
// the straight way from the shape's centre, which is all inside the shape, goes through the facet. Any other point is
// outside, at the side where it is. So a body on a table, under it and beside it are told apart without knowing which side
// of the table is its outside, or how thick the table is.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Distance beside a facet at which a point still counts as over it, as a share of its distance to the facet: facets whose
// angle is below the limit of MeshSurface have no edge between them.
constexpr double SLACK = 1e-5;
// Cosine of the angle between two directions from which on they are different ways out of a shape.
constexpr double SAME_WAY = 0.7;

void add_contact(const MovingPoint& point, int name, const Vec3& normal, double from_core, const Facet& facet,
                 const Patch& patch, std::vector<Contact>& contacts) {
  const double distance = from_core - point.radius;
  if (distance > point.reach) return;
  contacts.push_back({point.at - normal * from_core, normal, distance, name,
                      ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2])});
}

}  // namespace

bool goes_through(const Vec3& inside, const Vec3& at, const Facet& facet, const Patch& patch, double& share) {
  const Vec3 &a = patch.points[facet.corner[0]], &b = patch.points[facet.corner[1]], &c = patch.points[facet.corner[2]];
  const double from = dot(facet.normal, inside - a), to = dot(facet.normal, at - a);
  if (!(from * to < 0.0)) return false;
  share = from / (from - to);
  return inside_triangle(inside + (at - inside) * share, a, b, c, facet.normal, SLACK * std::abs(to));
}

bool comes_over(const Vec3& foot, const Vec3& n, double gap, double slack, const Vec3& velocity, double duration,
                const Facet& facet, const Patch& patch) {
  const Vec3 &a = patch.points[facet.corner[0]], &b = patch.points[facet.corner[1]], &c = patch.points[facet.corner[2]];
  if (inside_triangle(foot, a, b, c, facet.normal, SLACK * std::abs(gap))) return true;
  const double closing = -dot(n, velocity);
  if (!(gap >= 0.0 && closing * duration > gap)) return false;
  return inside_triangle(foot + (velocity + n * closing) * (gap / closing), a, b, c, facet.normal, slack);
}

bool touch_sheets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  const std::size_t first = contacts.size();
  const Facet* through = nullptr;
  double nearest = 1.0;
  for (const Facet& facet : patch.sheets) {
    const double from_plane = dot(facet.normal, point.at - patch.points[facet.corner[0]]);
    double share;
    if (goes_through(point.inside, point.at, facet, patch, share)) {
      if (share <= nearest) nearest = share, through = &facet;
      continue;
    }
    const double distance = std::abs(from_plane);
    if (through != nullptr || distance > point.radius + point.reach) continue;
    const Vec3 n = from_plane < 0.0 ? -facet.normal : facet.normal, foot = point.at - n * distance;
    if (comes_over(foot, n, distance - point.radius, point.radius, point.velocity, duration, facet, patch))
      add_contact(point, name, n, distance, facet, patch, contacts);
  }
  if (through == nullptr) return true;
  contacts.resize(first);
  const double from_plane = dot(through->normal, point.at - patch.points[through->corner[0]]);
  add_contact(point, name, from_plane < 0.0 ? through->normal : -through->normal, -std::abs(from_plane), *through, patch,
              contacts);
  return false;
}

void leave_by_nearest(std::size_t first, double radius, std::vector<Contact>& contacts) {
  const auto longer = [&](const Contact& contact) {
    if (contact.distance >= -radius) return false;
    return std::any_of(contacts.begin() + first, contacts.end(), [&](const Contact& other) {
      return other.ground_feature == contact.ground_feature && other.distance > contact.distance &&
             dot(other.normal, contact.normal) < SAME_WAY;
    });
  };
  std::vector<Contact> left;
  std::copy_if(contacts.begin() + first, contacts.end(), std::back_inserter(left),
               [&](const Contact& contact) { return !longer(contact); });
  contacts.resize(first);
  contacts.insert(contacts.end(), left.begin(), left.end());
}

}  // namespace smartmesh
