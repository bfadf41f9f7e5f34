// Contacts of the single features of a shape; `find_contacts` goes through all of them.
#pragma once

#include "contact.h"

namespace smartmesh {

// A point of a shape with its speed relative to the ground, grown by a radius.
struct MovingPoint {
  Vec3 at, velocity;
  double radius, reach;  // `reach` [m]: distance up to which it may come to the ground in the step
  Vec3 inside;           // a point deep inside the shape [m]
};

// Kinds of features of a body, for their names.
enum class BodyFeature : int { Vertex = 1, Face = 2, Edge = 3, Rim = 4, Side = 5 };

inline int name_of(BodyFeature kind, int number) { return (static_cast<int>(kind) << 24) + number; }

// Returns a name of the ground's points `a`, `b` and `c`, or of fewer (-1).
int ground_name(const Patch& patch, int a, int b = -1, int c = -1);

// Adds the contacts of a point with facets alone. Returns false if the point lies below the ground or has penetrated
// sheets; it then has no contacts with edges and peaks.
bool touch_facets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts);
bool touch_sheets(const MovingPoint& point, int name, const Patch& patch, double duration,
                  std::vector<Contact>& contacts);

// Returns true if the way from `inside` a shape to its point `at` goes through a facet; `share` [0 to 1] is the share
// of the way to there.
bool goes_through(const Vec3& inside, const Vec3& at, const Facet& facet, const Patch& patch, double& share);

// Returns true if a point is over a facet or will be when it reaches the facet within the step. `distance` [m]: to the
// facet's plane, along the unit normal `n` towards the point.
bool comes_over(const MovingPoint& point, const Vec3& n, double distance, double duration, const Facet& facet,
                const Patch& patch);

// Removes, of the contacts from number `first` on, those by which an edge of a mesh would leave a shape by a longer way
// than by another. `radius` [m]: by which the shape's core is grown.
void leave_by_nearest(std::size_t first, double radius, std::vector<Contact>& contacts);

void touch_vertex(const Convex& shape, const Pose& pose, int vertex, const Patch& patch, const Approach& approach,
                  std::vector<Contact>& contacts);
void touch_peak(const Convex& shape, const Pose& pose, const Peak& peak, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts);
void touch_edge(const Convex& shape, const Pose& pose, int edge, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts);
void touch_cylinder(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                    std::vector<Contact>& contacts);

}  // namespace smartmesh
