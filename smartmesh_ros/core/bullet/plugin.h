// The worlds that PyBullet's plugin interface knows, one for each client that loaded the plugin.
#pragma once

#include "world.h"

namespace smartmesh {

// Returns the world with the number that the plugin's command gave; null if its client was disconnected.
BulletWorld* world_of(int number);

}  // namespace smartmesh
