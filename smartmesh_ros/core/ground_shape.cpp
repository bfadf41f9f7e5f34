#include "ground_shape.h"

namespace smartmesh {

void GroundShape::processAllTriangles(btTriangleCallback* callback, const btVector3& least,
                                      const btVector3& most) const {
  Bounds bounds{from_bullet(least + origin), from_bullet(most + origin)};
  Patch patch;
  surface_->gather(bounds, *time_, Everything{}, patch);
  int number = 0;
  for (const auto* facets : {&patch.facets, &patch.sheets}) {
    for (const Facet& facet : *facets) {
      btVector3 corners[3];
      for (int j = 0; j < 3; ++j) corners[j] = to_bullet(patch.points[facet.corner[j]]) - origin;
      callback->processTriangle(corners, 0, number++);
    }
  }
}

}  // namespace smartmesh
