#include "contact/seams.h"

#include <algorithm>
#include <cmath>

#include "contact/cones.h"
#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Steps and gaps between two pieces that are flush [m]. Shapes are lifted over steps up to this height.
constexpr double FLUSH = 1e-3;
// Distance from a facet within which a contact is on it [m].
constexpr double ON = 1e-6;
// Cosine of the angle between two facets up to which both bear a body; at a larger angle one may be the side of a step.
constexpr double BEARS = 0.7;

bool are_parallel(const Vec3& a, const Vec3& b) { return norm2(cross(a, b)) <= SEAT * SEAT; }

// Returns true if a point is within a distance of a facet with the unit normal `n`.
bool is_within(const Vec3& p, const Vec3 (&corner)[3], const Vec3& n, double distance) {
  double weights[3];
  return std::abs(dot(n, p - corner[0])) <= distance &&
         nearest_weights(p, corner[0], corner[1], corner[2], n, weights) <= distance * distance;
}

}  // namespace

void Seams::add(const ContactSearch& search, const Pose& frame) {
  add(search.maps, frame);
  add(search.meshes, frame);
}

void Seams::add(const Patch& patch, const Pose& frame) {
  int piece = pieces();
  long mesh = -1;
  for (const Facet& facet : patch.facets) {
    const auto& k = facet.corner;
    if (const long number = patch.mesh_of(facet); number != mesh) mesh = number, ++piece;
    facets_.push_back(
        {{frame.to_world(patch.points[k[0]]), frame.to_world(patch.points[k[1]]), frame.to_world(patch.points[k[2]])},
         frame.rotation * facet.normal,
         piece});
  }
}

void Seams::remove_hidden(const ContactSearch& beside, const Vec3& inside, std::vector<Contact>& contacts) {
  const std::vector<Facet>& of_meshes = beside.meshes.facets;
  const bool is_one_mesh =
      of_meshes.empty() || beside.meshes.mesh_of(of_meshes.front()) == beside.meshes.mesh_of(of_meshes.back());
  if (facets_.empty() && is_one_mesh && (of_meshes.empty() || beside.maps.facets.empty())) return;
  add(beside, {});
  if (pieces() < 2) return;
  double deepest = 0.0;  // of a point of the shape below any piece [m]
  for (const Contact& contact : contacts) deepest = std::max(deepest, -contact.distance);
  const auto hidden = [&](const Contact& contact) {
    return is_inside_plane(contact) || std::any_of(facets_.begin(), facets_.end(), [&](const PieceFacet& facet) {
             return is_hidden_by(facet, inside, deepest, contact);
           });
  };
  contacts.erase(std::remove_if(contacts.begin(), contacts.end(), hidden), contacts.end());
}

// Corners of a shape touch a plane. What its edges and faces touch there is between them, and would take their places
// among the few contacts that are chosen.
bool Seams::is_inside_plane(const Contact& contact) const {
  const int kind = contact.body_feature >> 24;
  if (kind != static_cast<int>(BodyFeature::Edge) && kind != static_cast<int>(BodyFeature::Face)) return false;
  const Vec3& n = contact.normal;
  const Vec3 along = unit(cross(n, std::abs(n.x) < 0.5 ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0}));
  const Vec3 across = cross(n, along);
  const Vec3 ways[] = {along, across, -along, -across};
  return std::all_of(std::begin(ways), std::end(ways), [&](const Vec3& way) {
    const Vec3 beside = contact.point + way * (2.0 * FLUSH);
    return std::any_of(facets_.begin(), facets_.end(),
                       [&](const PieceFacet& facet) { return is_within(beside, facet.corner, facet.normal, ON); });
  });
}

// A contact is against a facet of another piece if it lies on that facet and its normal is outside the facet's cone. It
// is real only if its own piece stands out of the facet there: by a facet with that normal, or by two facets with an
// edge between them. Else it belongs to a rim that is hidden. A contact that overlaps may leave the cone by SEAT, as
// within one piece.
bool Seams::is_hidden_by(const PieceFacet& facet, const Vec3& inside, double deepest, const Contact& contact) const {
  const Vec3 &p = contact.point, &n = contact.normal, &origin = facet.corner[0];
  const Vec3 out = dot(facet.normal, inside - origin) < 0.0 ? -facet.normal : facet.normal;
  // `ahead` [m]: way along the normal from the shape to a contact that it does not touch yet. `higher` [m]: how far the
  // shape is above the contact, seen from the facet. A rim that the shape meets on this way is up to `beside` [m] from
  // the contact.
  const double ahead = std::max(0.0, contact.distance), higher = ahead * dot(out, n);
  const double lift = std::clamp(-dot(out, p - origin), std::min(0.0, higher), std::max(deepest, higher));
  const Vec3 lifted = p + out * lift;
  const double beside = lift < 0.0 ? -lift / norm(cross(out, n)) : lift;
  if (!is_within(lifted, facet.corner, facet.normal, FLUSH)) return false;
  const double slack = contact.distance > 0.0 ? CONE_TOLERANCE : SEAT;
  const bool is_against = std::any_of(std::begin(facet.corner), std::end(facet.corner),
                                      [&](const Vec3& corner) { return !is_below(n, lifted, corner, slack); });
  if (!is_against) return false;
  // Beside the facet, only its own piece bears the body there.
  const bool bears = dot(out, n) > BEARS && !is_within(lifted, facet.corner, facet.normal, ON);
  bool is_on_piece = false;
  const PieceFacet* standing = nullptr;
  for (const PieceFacet& own : facets_) {
    if (own.piece == facet.piece) continue;
    const bool is_touched = are_parallel(own.normal, n);
    if (!is_within(p, own.corner, own.normal, is_touched && ahead > 0.0 ? FLUSH + beside : ON)) continue;
    if (is_touched && bears) return false;
    is_on_piece = true;
    if (std::none_of(std::begin(own.corner), std::end(own.corner),
                     [&](const Vec3& corner) { return dot(out, corner - origin) > FLUSH; }))
      continue;
    if (is_touched || (standing != nullptr && !are_parallel(own.normal, standing->normal))) return false;
    standing = &own;
  }
  return is_on_piece;
}

}  // namespace smartmesh
