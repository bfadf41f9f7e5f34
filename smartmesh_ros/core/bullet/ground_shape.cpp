#include "bullet/ground_shape.h"

#include "bullet/world.h"
#include "step/step_lock.h"

namespace smartmesh {

void GroundShape::processAllTriangles(btTriangleCallback* callback, const btVector3& least,
                                      const btVector3& most) const {
  const Instant& now = world_->now;
  const StepLock lock;  // a window asks at any moment what lies under the mouse
  if (now.drawn && !now.stepping) return;
  const Bounds bounds{from_bullet(least + origin), from_bullet(most + origin)};
  int number = 0;
  const auto add = [&](Tiles& tiles, const Pose& frame, const Bounds& inside) {
    Patch maps, meshes;
    tiles.gather(inside, now.time, 0.0, Everything{}, maps);
    tiles.gather_meshes(inside, now.time, 0.0, Everything{}, meshes);
    for (const Patch* patch : {&maps, &meshes}) {
      for (const Facet& facet : patch->facets) {
        btVector3 corners[3];
        for (int j = 0; j < 3; ++j) corners[j] = to_bullet(frame.to_world(patch->points[facet.corner[j]])) - origin;
        callback->processTriangle(corners, 0, number++);
      }
    }
  };
  world_->guarded([&] {
    add(*now.terrain, {}, bounds);
    for (Deck* deck : now.terrain->decks()) {
      const Pose frame = deck->motion.at(now.time).pose;
      add(deck->tiles, frame, Deck::local_bounds(frame, bounds));
    }
  });
}

}  // namespace smartmesh
