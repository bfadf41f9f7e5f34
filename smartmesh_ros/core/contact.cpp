#include "contact.h"

#include <algorithm>

#include "contact_pairs.h"

namespace smartmesh {

namespace {

// By how much normals may leave their cones, as a sine, with room for narrow triangles.
constexpr double SLACK = 0.01;

// Returns true if an edge faces the ground: edges touch by normals that lie between those of the faces of both.
bool faces_ground(const Convex& shape, const Pose& pose, const PolyEdge& edge, const Patch& patch) {
  if (edge.faces[0] < 0 || patch.steepest < SLACK) return true;
  const double up = std::min(dot(pose.turn.row[2], shape.core.faces[edge.faces[0]].normal),
                             dot(pose.turn.row[2], shape.core.faces[edge.faces[1]].normal));
  return up <= (SLACK - patch.steepest) * edge.half_cosine;
}

}  // namespace

void find_contacts(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                   std::vector<Contact>& contacts) {
  if (patch.facets.empty()) return;
  if (shape.kind == ShapeKind::Cylinder) {
    touch_cylinder(shape, pose, patch, approach, contacts);
    return;
  }
  const Polytope& core = shape.core;
  // Most features of a hull of many vertices lie above all ground in reach.
  const double limit = patch.highest + shape.rounding + approach.reach(pose.at, shape.reach);
  std::vector<char> low(core.vertices.size());
  for (std::size_t k = 0; k < core.vertices.size(); ++k) {
    low[k] = dot(pose.turn.row[2], core.vertices[k]) + pose.at.z <= limit;
    if (low[k]) touch_vertex(shape, pose, static_cast<int>(k), patch, approach, contacts);
  }
  for (const Peak& peak : patch.peaks) touch_peak(shape, pose, peak, patch, approach, contacts);
  for (std::size_t k = 0; k < core.edges.size(); ++k)
    if ((low[core.edges[k].end[0]] || low[core.edges[k].end[1]]) && faces_ground(shape, pose, core.edges[k], patch))
      touch_edge(shape, pose, static_cast<int>(k), patch, approach, contacts);
}

}  // namespace smartmesh
