// Finds the world of a PyBullet server, whether it has a window or not.
#pragma once

class PhysicsCommandProcessorInterface;
class btDiscreteDynamicsWorld;

namespace smartmesh {

// Where a server keeps its world. `resetSimulation` writes another world there, the end of the client null.
using WorldPlace = btDiscreteDynamicsWorld* const volatile*;

// Returns the place of a server's world; null if the server's memory is laid out otherwise. Call it from the server's
// thread.
WorldPlace world_place(PhysicsCommandProcessorInterface& server);

}  // namespace smartmesh
