// A point of a shape against the facets of height maps.
#include <algorithm>

#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Cosine of the angle between facets that are in one plane, less than 1 by this.
constexpr double SAME_PLANE = 1e-12;
// Height above a facet to which a point below it is lifted, against rounding [m].
constexpr double LIFT = 1e-9;

// A point that may lie below the ground, behind several facets at once.
class FacetTouch {
 public:
  FacetTouch(const MovingPoint& point, int name, const Patch& patch, double duration, std::vector<Contact>& contacts)
      : free_(point), name_(name), patch_(patch), duration_(duration), contacts_(contacts) {}

  // Adds all contacts, and returns true if the point is not below the ground.
  bool run() {
    const std::size_t first = contacts_.size();
    touch_all();
    while (is_below_ && count_ < MOST_BEHIND) {
      double distance;
      const int way = way_out(free_, patch_, distance);
      if (way < 0) break;
      contacts_.resize(first + count_);  // what the point touches is not known before it is out of the ground
      lift_out(patch_.facets[way], distance);
      touch_all();
    }
    return count_ == 0;
  }

 private:
  void touch_all() {
    is_below_ = false;
    const double most = free_.radius + free_.contact_distance + ROUNDING;
    const PatchCells& cells = patch_.cells;
    const CellRange near = cells.near(free_.at.x, free_.at.y, most, most);
    for (int r = near.top; r < near.bottom; ++r)
      for (int f = cells.facets[cells.at(r, near.left)]; f < cells.facets[cells.at(r, near.right - 1) + 1]; ++f)
        touch(patch_.facets[f]);
  }

  void touch(const Facet& facet) {
    const auto& p = patch_.points;
    const Vec3 &a = p[facet.corner[0]], &b = p[facet.corner[1]], &c = p[facet.corner[2]];
    const double distance = dot(facet.normal, free_.at - a);
    if (distance > free_.radius + free_.contact_distance || is_behind(facet, distance)) return;
    if (distance < 0.0)
      is_below_ |= is_over(free_.at, a, b, c);
    else if (faces(free_, facet.normal, free_.angle) &&
             comes_over(free_, facet.normal, distance, duration_, 0.0, facet, patch_))
      add_contact(free_, name_, facet.normal, distance, ground_name(patch_, facet), contacts_);
  }

  // Returns true if the point was lifted out of this facet, or of one whose plane goes on in it.
  bool is_behind(const Facet& facet, double distance) const {
    return std::any_of(behind_, behind_ + count_, [&](const Facet* other) {
      return other == &facet || (std::abs(distance) < ROUNDING && dot(facet.normal, other->normal) > 1.0 - SAME_PLANE);
    });
  }

  void lift_out(const Facet& facet, double distance) {
    add_contact(free_, name_, facet.normal, distance, ground_name(patch_, facet), contacts_);
    free_.at = free_.at + facet.normal * (LIFT - distance);
    free_.velocity = free_.velocity - facet.normal * std::min(0.0, dot(facet.normal, free_.velocity));
    behind_[count_++] = &facet;
  }

  MovingPoint free_;  // the point, lifted out of the ground
  const int name_;
  const Patch& patch_;
  const double duration_;
  std::vector<Contact>& contacts_;
  const Facet* behind_[MOST_BEHIND];
  int count_ = 0;
  bool is_below_ = false;
};

}  // namespace

int way_out(const MovingPoint& point, const Patch& patch, double& distance) {
  const auto& p = patch.points;
  const PatchCells& cells = patch.cells;
  int facet = -1;
  bool is_below = false;
  const auto look = [&](double half, bool only_over) {
    const CellRange near = cells.near(point.at.x, point.at.y, half, half);
    for (int r = near.top; r < near.bottom; ++r) {
      for (int f = cells.facets[cells.at(r, near.left)]; f < cells.facets[cells.at(r, near.right - 1) + 1]; ++f) {
        const Facet& it = patch.facets[f];
        const Vec3 &a = p[it.corner[0]], &b = p[it.corner[1]], &c = p[it.corner[2]];
        const double from_plane = dot(it.normal, point.at - a);
        if (!(from_plane < 0.0 && from_plane > distance)) continue;
        const bool over = is_over(point.at, a, b, c);
        if (!over && (only_over || !inside_triangle(point.at - it.normal * from_plane, a, b, c, it.normal, 0.0)))
          continue;
        is_below |= over;
        if (!faces(point, it.normal)) continue;
        distance = from_plane;
        facet = f;
      }
    }
  };
  distance = -1e300;
  look(ROUNDING, true);
  if (is_below) look(facet >= 0 ? -distance + ROUNDING : cells.resolution, false);
  return facet;
}

bool comes_over(const MovingPoint& point, const Vec3& n, double distance, double duration, double slack,
                const Facet& facet, const Patch& patch) {
  const auto& p = patch.points;
  const auto& k = facet.corner;
  const Vec3 projected = point.at - n * distance;
  if (inside_triangle(projected, p[k[0]], p[k[1]], p[k[2]], facet.normal, slack * distance)) return true;
  const double closing = -dot(n, point.velocity), gap = distance - point.radius;
  if (!(gap >= 0.0 && closing * duration > gap)) return false;
  const Vec3 then = projected + (point.velocity + n * closing) * (gap / closing);
  if (inside_triangle(then, p[k[0]], p[k[1]], p[k[2]], facet.normal, slack * point.radius)) return true;
  // A point that comes down on one facet may slide on to the next one within the step.
  const Vec3 way = point.velocity * duration, end = point.at + way - n * point.radius;
  const double slide = closing * duration;
  const Vec3 under = projected + way + n * slide;
  if (patch.is_mesh)
    return (inside_triangle(then, p[k[0]], p[k[1]], p[k[2]], facet.normal, slide) ||
            inside_triangle(under, p[k[0]], p[k[1]], p[k[2]], facet.normal, slide)) &&
           penetrated(point.inside + way, end, patch) == &facet;
  if (!is_over(end, p[k[0]], p[k[1]], p[k[2]]) && !inside_triangle(under, p[k[0]], p[k[1]], p[k[2]], facet.normal, 0.0))
    return false;
  double depth;
  const int out = way_out({end, point.velocity, 0.0, 0.0, point.inside + way}, patch, depth);
  return out >= 0 && &patch.facets[out] == &facet;
}

bool touch_facets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts) {
  return FacetTouch(point, name, patch, duration, contacts).run();
}

}  // namespace smartmesh
