#include "contact.h"

#include "contact_pairs.h"

namespace smartmesh {

void find_contacts(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                   std::vector<Contact>& contacts) {
  if (shape.cylinder) {
    touch_cylinder(shape, pose, patch, approach, contacts);
    return;
  }
  const Polytope& core = shape.core;
  for (std::size_t k = 0; k < core.vertices.size(); ++k)
    touch_vertex(shape, pose, static_cast<int>(k), patch, approach, contacts);
  for (const Peak& peak : patch.peaks) touch_peak(shape, pose, peak, patch, approach, contacts);
  const std::size_t first = contacts.size();
  for (std::size_t k = 0; k < core.edges.size(); ++k)
    touch_edge(shape, pose, static_cast<int>(k), patch, approach, contacts);
  if (!patch.sheets.empty()) leave_by_nearest(first, shape.radius, contacts);
}

}  // namespace smartmesh
