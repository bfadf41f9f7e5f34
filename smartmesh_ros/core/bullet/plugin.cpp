// Entry points of PyBullet's plugin interface. `p.loadPlugin(path, "_smartmesh")` finds them by name.
#include <memory>
#include <random>
#include <unordered_map>

#include <examples/SharedMemory/PhysicsCommandProcessorInterface.h>
#include <examples/SharedMemory/SharedMemoryPublic.h>
#include <examples/SharedMemory/plugins/b3PluginContext.h>

#include "bullet/world.h"
#include "step/step_lock.h"

namespace smartmesh {

namespace {

// The ground in the server of a client.
struct Client {
  int number;
  std::unique_ptr<BulletWorld> ground;
};

std::unordered_map<int, BulletWorld*>& grounds() {
  static auto* all = new std::unordered_map<int, BulletWorld*>();  // never freed: PyBullet may outlive this library
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
  auto client = std::make_unique<Client>(Client{new_number(), std::make_unique<BulletWorld>(place)});
  grounds()[client->number] = client->ground.get();
  context.m_userPointer = client.release();
}

void leave(Client* client) {
  grounds().erase(client->number);
  if (!client->ground->leave()) client->ground.release();
  delete client;
}

}  // namespace

BulletWorld* world_of(int number) {
  const auto found = grounds().find(number);
  if (found == grounds().end()) return nullptr;
  found->second->look();
  return found->second->alive() ? found->second : nullptr;
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
  BulletWorld& ground = *client_of(*context)->ground;
  ground.guarded([&] {
    ground.look();
    for (int k = 0; k < context->m_numNotifications; ++k) {
      const b3Notification& it = context->m_notifications[k];
      if (it.m_notificationType == BODY_ADDED) ground.note_added();
      if (it.m_notificationType == BODY_REMOVED) ground.note_removed(it.m_bodyArgs.m_bodyUniqueId);
    }
  });
  return 0;
}

// The lock is held until `postTickPluginCallback`.
PLUGIN int preTickPluginCallback_smartmesh(b3PluginContext* context) {
  step_mutex().lock();
  BulletWorld& ground = *client_of(*context)->ground;
  ground.guarded([&] {
    ground.look();
    ground.before_step();
  });
  return 0;
}

PLUGIN int postTickPluginCallback_smartmesh(b3PluginContext* context) {
  BulletWorld& ground = *client_of(*context)->ground;
  ground.guarded([&] { ground.after_step(); });
  step_mutex().unlock();
  return 0;
}
