#include "ground_shape.h"

namespace smartmesh {

void GroundShape::processAllTriangles(btTriangleCallback* callback, const btVector3& least,
                                      const btVector3& most) const {
  Bounds bounds{from_bullet(least + origin), from_bullet(most + origin)};
  Patch maps, meshes;
  surface_->gather(bounds, *time_, 0.0, Everything{}, maps);
  surface_->gather_meshes(bounds, *time_, 0.0, Everything{}, meshes);
  int number = 0;
  for (const Patch* patch : {&maps, &meshes}) {
    for (const Facet& facet : patch->facets) {
      btVector3 corners[3];
      for (int j = 0; j < 3; ++j) corners[j] = to_bullet(patch->points[facet.corner[j]]) - origin;
      callback->processTriangle(corners, 0, number++);
    }
  }
}

}  // namespace smartmesh
