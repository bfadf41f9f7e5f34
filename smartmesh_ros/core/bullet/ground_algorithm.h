// Registration of the core's contact generation in Bullet's dispatcher.
#pragma once

class btDiscreteDynamicsWorld;

namespace smartmesh {

class BulletWorld;

// Makes pairs of a convex shape and a ground proxy collide by `ground`.
void register_algorithm(btDiscreteDynamicsWorld& world, BulletWorld* ground);

}  // namespace smartmesh
