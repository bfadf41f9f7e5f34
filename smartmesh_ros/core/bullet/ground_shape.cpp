#include "ground_shape.h"

#include "step_lock.h"
#include "world.h"

namespace smartmesh {

void GroundShape::processAllTriangles(btTriangleCallback* callback, const btVector3& least,
                                      const btVector3& most) const {
  const StepLock lock;  // a window asks at any moment what lies under the mouse
  if (world_->drawn && !world_->is_stepping()) return;
  const Bounds bounds{from_bullet(least + origin), from_bullet(most + origin)};
  world_->guarded([&] {
    Patch maps, meshes;
    world_->surface.gather(bounds, world_->time, 0.0, Everything{}, maps);
    world_->surface.gather_meshes(bounds, world_->time, 0.0, Everything{}, meshes);
    int number = 0;
    for (const Patch* patch : {&maps, &meshes}) {
      for (const Facet& facet : patch->facets) {
        btVector3 corners[3];
        for (int j = 0; j < 3; ++j) corners[j] = to_bullet(patch->points[facet.corner[j]]) - origin;
        callback->processTriangle(corners, 0, number++);
      }
    }
  });
}

}  // namespace smartmesh
