// Facets of meshes, which are touched from both sides.
//
// The straight way from a shape's centre to a point of the shape lies inside the shape. If the way goes through a
// facet, the point has penetrated the facet, and leaves it at the side of the centre. Otherwise the point has not, and
// is touched from the side where the point is. So bodies on a table, under it and beside it are right without knowing
// which side of a facet is its outside, or how thick the table is.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Distance beside a facet at which a point still counts as over the facet, as a share of its distance to the facet: two
// facets whose angle is below the limit of MeshSurface have no edge between them.
constexpr double SLACK = 1e-5;
// Cosine of the angle between two directions from which on they are different ways out of a shape.
constexpr double SAME_WAY = 0.7;

// Share by which the way from a shape's centre to its point is longer, so that a point on a facet is behind it.
constexpr double TOUCHING = 1e-6;
// Number of facets behind which a point may be at once, as in the corner of a room.
constexpr int MOST_BEHIND = 3;

void add_contact(const MovingPoint& point, int name, const Vec3& normal, double from_core, const Facet& facet,
                 const Patch& patch, std::vector<Contact>& contacts) {
  const double distance = from_core - point.radius;
  if (distance > point.reach) return;
  contacts.push_back({point.at - normal * from_core, normal, distance, name,
                      ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2])});
}

// Returns the facet that is first on the way to `at`; null = none.
const Facet* first_on_way(const Vec3& inside, const Vec3& at, const Patch& patch) {
  const Facet* first = nullptr;
  double nearest = 1.0;
  for (const Facet& facet : patch.sheets) {
    double share;
    if (goes_through(inside, at, facet, patch, share) && share <= nearest) nearest = share, first = &facet;
  }
  return first;
}

}  // namespace

bool goes_through(const Vec3& inside, const Vec3& at, const Facet& facet, const Patch& patch, double& share) {
  const Vec3 &a = patch.points[facet.corner[0]], &b = patch.points[facet.corner[1]], &c = patch.points[facet.corner[2]];
  const double from = dot(facet.normal, inside - a), to = dot(facet.normal, at - a);
  if (!(from * to < 0.0)) return false;
  share = from / (from - to);
  return inside_triangle(inside + (at - inside) * share, a, b, c, facet.normal, SLACK * std::abs(to));
}

bool comes_over(const MovingPoint& point, const Vec3& n, double distance, double duration, const Facet& facet,
                const Patch& patch) {
  const Vec3 &a = patch.points[facet.corner[0]], &b = patch.points[facet.corner[1]], &c = patch.points[facet.corner[2]];
  const Vec3 foot = point.at - n * distance;
  if (inside_triangle(foot, a, b, c, facet.normal, SLACK * distance)) return true;
  const double closing = -dot(n, point.velocity), gap = distance - point.radius;
  if (!(gap >= 0.0 && closing * duration > gap)) return false;
  return inside_triangle(foot + (point.velocity + n * closing) * (gap / closing), a, b, c, facet.normal, 0.0);
}

bool touch_sheets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  // The point is lifted out of the facets that it penetrates. Facets that are hidden below them are then not over it.
  MovingPoint lifted = point;
  const Facet* behind[MOST_BEHIND];
  int count = 0;
  const Vec3 arm = point.at - point.inside;
  const double lift = SLACK * (norm(arm) + point.reach);
  while (count < MOST_BEHIND && norm2(arm) > 0.0) {
    const Facet* facet = first_on_way(point.inside, lifted.at + (lifted.at - point.inside) * TOUCHING, patch);
    if (facet == nullptr) break;
    const Vec3& corner = patch.points[facet->corner[0]];
    const Vec3 n = dot(facet->normal, point.inside - corner) < 0.0 ? -facet->normal : facet->normal;
    const double from_plane = dot(n, lifted.at - corner);
    add_contact(lifted, name, n, from_plane, *facet, patch, contacts);
    lifted.at = lifted.at + n * (lift - from_plane);
    behind[count++] = facet;
  }
  for (const Facet& facet : patch.sheets) {
    const double from_plane = dot(facet.normal, lifted.at - patch.points[facet.corner[0]]);
    const double distance = std::abs(from_plane);
    if (distance > point.radius + point.reach || std::find(behind, behind + count, &facet) != behind + count) continue;
    const Vec3 n = from_plane < 0.0 ? -facet.normal : facet.normal;
    if (comes_over(lifted, n, distance, duration, facet, patch))
      add_contact(lifted, name, n, distance, facet, patch, contacts);
  }
  return count == 0;
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
