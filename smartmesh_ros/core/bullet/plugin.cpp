// Entry points of PyBullet's plugin interface. `p.loadPlugin(path, "_smartmesh")` finds them by name.
#include <malloc.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <random>
#include <unordered_map>
#include <vector>

#include <examples/CommonInterfaces/CommonGUIHelperInterface.h>
#include <examples/SharedMemory/PhysicsCommandProcessorInterface.h>
#include <examples/SharedMemory/SharedMemoryPublic.h>
#include <examples/SharedMemory/plugins/b3PluginContext.h>

#include "bullet/world.h"
#include "step/step_lock.h"

namespace smartmesh {

namespace {

// Where a server keeps its world. `resetSimulation` writes another world there, the end of the client null.
using WorldPlace = btDiscreteDynamicsWorld* const volatile*;

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

// Returns the place of a server's world, whether the server has a window or not; null if the server's memory is laid
// out otherwise. Call it from the server's thread.
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

// A client, the place of its server's world, and the ground in that world; null if there is none.
struct Client {
  int number;
  WorldPlace place;
  int worlds = 0;  // that it has had
  std::unique_ptr<BulletWorld> ground{};

  // Takes the world that the server has now. Call it before anything else that is done from outside.
  BulletWorld* look() {
    btDiscreteDynamicsWorld* world = *place;
    if (ground != nullptr && !ground->is_in(world)) ground.reset();
    if (ground == nullptr && world != nullptr) ground = std::make_unique<BulletWorld>(*world, ++worlds);
    return ground.get();
  }
};

std::unordered_map<int, Client*>& clients() {
  static auto* all = new std::unordered_map<int, Client*>();  // never freed: PyBullet may outlive this library
  return *all;
}

// Returns a number for a client that servers in other processes do not give to theirs.
int new_number() {
  static int last = static_cast<int>(std::random_device{}() >> 2);
  return ++last;
}

Client* client_of(const b3PluginContext& context) { return static_cast<Client*>(context.m_userPointer); }

void enter(b3PluginContext& context) {
  const WorldPlace place = world_place(*context.m_rpcCommandProcessorInterface);
  if (place == nullptr) throw std::runtime_error("the server has no world where it is looked for");
  auto client = std::make_unique<Client>(Client{new_number(), place});
  client->look();
  clients()[client->number] = client.get();
  context.m_userPointer = client.release();
}

void leave(Client* client) {
  clients().erase(client->number);
  if (client->look() != nullptr) client->ground.release()->leave();  // the world's pairs still name it
  delete client;
}

}  // namespace

BulletWorld* world_of(int client) {
  const auto found = clients().find(client);
  return found == clients().end() ? nullptr : found->second->look();
}

}  // namespace smartmesh

using namespace smartmesh;

#define PLUGIN extern "C" __attribute__((visibility("default")))

PLUGIN int initPlugin_smartmesh(b3PluginContext* context) {
  const StepLock lock;
  try {
    enter(*context);
    return SHARED_MEMORY_MAGIC_NUMBER;
  } catch (...) {
    return -1;  // PyBullet does not load the plugin then
  }
}

PLUGIN void exitPlugin_smartmesh(b3PluginContext* context) {
  const StepLock lock;
  try {
    leave(client_of(*context));
  } catch (...) {
  }
}

// Returns the number of the client's world.
PLUGIN int executePluginCommand_smartmesh(b3PluginContext* context, const b3PluginArguments*) {
  return client_of(*context)->number;
}

// PyBullet tells of bodies that it made or removed, at the end of the command that did so.
PLUGIN int processNotifications_smartmesh(b3PluginContext* context) {
  const StepLock lock;
  BulletWorld* ground = client_of(*context)->look();
  if (ground == nullptr) return 0;
  ground->guarded([&] {
    for (int k = 0; k < context->m_numNotifications; ++k) {
      const b3Notification& it = context->m_notifications[k];
      if (it.m_notificationType == BODY_ADDED) ground->attached.note_change();
      if (it.m_notificationType == BODY_REMOVED) ground->note_removed(it.m_bodyArgs.m_bodyUniqueId);
    }
  });
  return 0;
}

// The lock is held until `postTickPluginCallback`.
PLUGIN int preTickPluginCallback_smartmesh(b3PluginContext* context) {
  step_mutex().lock();
  if (BulletWorld* ground = client_of(*context)->look(); ground != nullptr)
    ground->guarded([&] { ground->before_step(); });
  return 0;
}

PLUGIN int postTickPluginCallback_smartmesh(b3PluginContext* context) {
  if (BulletWorld* ground = client_of(*context)->ground.get(); ground != nullptr)
    ground->guarded([&] { ground->after_step(); });
  step_mutex().unlock();
  return 0;
}
