#include "bullet/server_world.h"

#include <malloc.h>

#include <algorithm>
#include <iterator>
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
  // The server's own helper, which draws its window, is where the catcher is now, and is put back.
  const void* caught = static_cast<GUIHelperInterface*>(catcher);
  void** helper = data;
  while (helper != end && (*helper != caught || before[helper - data] == caught)) ++helper;
  if (helper == end) return nullptr;
  *static_cast<void* volatile*>(helper) = before[helper - data];
  // The world is kept in front of the helper. Memory farther away may hold the same address, left by another server.
  const auto place = std::find(std::reverse_iterator(helper), std::reverse_iterator(data), catcher->world);
  return place.base() == data ? nullptr : reinterpret_cast<WorldPlace>(place.base() - 1);
}

}  // namespace smartmesh
