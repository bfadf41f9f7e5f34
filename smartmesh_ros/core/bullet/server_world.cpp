#include "server_world.h"

#include <malloc.h>

#include <algorithm>
#include <vector>

#include <examples/CommonInterfaces/CommonGUIHelperInterface.h>
#include <examples/SharedMemory/PhysicsCommandProcessorInterface.h>

namespace smartmesh {

namespace {

// A server hands its world to the helper for graphics that it is given.
struct WorldCatcher final : DummyGUIHelper {
  btDiscreteDynamicsWorld* world = nullptr;
  void createPhysicsDebugDrawer(btDiscreteDynamicsWorld* found) override { world = found; }
};

// The members of PhysicsServerCommandProcessor, all of whose data is in one allocation.
struct Server {
  void* functions;
  void** data;
};

}  // namespace

WorldPlace world_place(PhysicsCommandProcessorInterface& server) {
  static auto* catcher = new WorldCatcher();  // never freed: the thread of a window may just be calling it
  void** data = reinterpret_cast<Server&>(server).data;
  void** end = data + malloc_usable_size(data) / sizeof(void*);
  const std::vector<void*> before(data, end);
  server.setGuiHelper(catcher);
  // The server's own helper draws its window, and is put back. It is found by what took its place.
  void** helper = std::find(data, end, static_cast<void*>(static_cast<GUIHelperInterface*>(catcher)));
  if (helper == end) return nullptr;
  *static_cast<void* volatile*>(helper) = before[helper - data];
  void** place = std::find(data, end, static_cast<void*>(catcher->world));
  return catcher->world == nullptr || place == end ? nullptr : reinterpret_cast<WorldPlace>(place);
}

}  // namespace smartmesh
