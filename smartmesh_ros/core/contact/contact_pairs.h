// Contacts of the single features of a shape; `ContactSearch` goes through all of them.
#pragma once

#include <algorithm>

#include "contact/contact.h"

namespace smartmesh {

// A point of a shape with its speed relative to the ground, grown by a radius. `contact_distance` [m]: up to which it
// may come to the ground in the step.
struct MovingPoint {
  Vec3 at, velocity;
  double radius, contact_distance;
  Vec3 inside;         // a point deep inside the shape [m]
  double angle = 0.0;  // angle by which the shape may rotate in the step [rad]
};

// Returns true if a plane with the unit normal `n` that touches a point of a shape has the shape's inside above it. A
// point that slides over a crest would else be held back by the flank that it comes from. `angle`: angle by which the
// shape may rotate before the plane touches it [rad].
inline bool faces(const MovingPoint& point, const Vec3& n, double angle = 0.0) {
  const Vec3 inwards = point.inside - point.at;
  return dot(n, inwards) >= -point.radius - angle * norm(inwards);
}

// Kinds of features of a body, for their names.
enum class BodyFeature : int { Vertex = 1, Face = 2, Edge = 3, Rim = 4, Side = 5 };

inline int name_of(BodyFeature kind, int number) { return (static_cast<int>(kind) << 24) + number; }

// Returns a name of the ground's points `a`, `b` and `c`, or of fewer (-1).
int ground_name(const Patch& patch, int a, int b = -1, int c = -1);
inline int ground_name(const Patch& patch, const Facet& facet) {
  return ground_name(patch, facet.corner[0], facet.corner[1], facet.corner[2]);
}

// Added to distances in which features are looked for, against rounding [m].
constexpr double ROUNDING = 1e-6;

// Largest number of facets behind which a point may be at once, as in the corner of a room.
constexpr int MOST_BEHIND = 3;

// Adds the contacts of a point with facets alone. A point below the ground is lifted out of it by the shortest way, and
// touches what is over it from there. Returns false if it lies below the ground; it then has no contacts with edges and
// peaks.
bool touch_facets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts);

// Adds the contacts of a point with facets of meshes alone. Returns false if the point has penetrated a facet; it then
// has no contacts with edges and peaks.
bool touch_sheets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts);

// Adds a contact of a point with a plane at this distance from it [m].
void add_contact(const MovingPoint& point, int name, const Vec3& normal, double from_core, int ground,
                 std::vector<Contact>& contacts);

// Returns the facet of a mesh through which a point `at` of a shape leaves the ground, null if it has not penetrated
// the ground; `inside`: a point deep inside the shape.
const Facet* penetrated(const Vec3& inside, const Vec3& at, const Patch& patch);

// Returns the normal of a facet to the side of `p`.
Vec3 normal_towards(const Vec3& p, const Facet& facet, const Patch& patch);

// Returns true if a point is over a facet or will be when it reaches the facet within the step. `distance` [m]: to the
// facet's plane, along the unit normal `n` towards the point. Beside the facet it still counts as over it by a share
// `slack` of the distance.
bool comes_over(const MovingPoint& point, const Vec3& n, double distance, double duration, double slack,
                const Facet& facet, const Patch& patch);

// Returns the facet through which a point below the ground leaves it by the shortest way, towards the inside of its
// shape; -1 if none is over the point. `distance` [m]: from that facet's plane, negative.
int way_out(const MovingPoint& point, const Patch& patch, double& distance);

// Share of a depth below which another way out makes a contact false: the shape is then beyond a thin ridge, or over a
// cliff. Raising it loses contacts of shapes that could leave by a way that nothing else finds.
constexpr double MUCH_SHORTER = 0.5;

// Returns true if a line on a shape may touch an edge of the ground where it is nearest to the edge's line, at the
// share `t` of it. Beyond the end of an edge it may only overlap: what the shape touches in an inner corner goes on
// there.
inline bool is_on_edge(double t, double distance) { return distance < 0.0 || (t > 0.0 && t < 1.0); }

// Returns true if an edge that overlaps a shape passes through it, is not touched beyond a peak that is touched from
// the same direction `n`, and the shape can leave the edge's facets by no way that is much shorter: along one of their
// normals, out of one of its own faces, or out of the side of a cylinder where the edge is nearest to what touches it,
// at the share `t`. `distance` [m]: of the edge from the shape, negative.
bool is_shortest(const Convex& shape, const Pose& pose, const Patch& patch, const Edge& edge, double t, const Vec3& n,
                 double distance);

void touch_vertex(const Convex& shape, const Pose& pose, int vertex, const Patch& patch, const Approach& approach,
                  std::vector<Contact>& contacts);
void touch_peak(const Convex& shape, const Pose& pose, const Peak& peak, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts);
void touch_edge(const Convex& shape, const Pose& pose, int edge, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts);
void touch_cylinder(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                    std::vector<Contact>& contacts);

}  // namespace smartmesh
