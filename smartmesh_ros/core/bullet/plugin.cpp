// Entry points of PyBullet's plugin interface. `p.loadPlugin(path, "_smartmesh")` finds them by name.
#include <memory>
#include <vector>

#include <examples/CommonInterfaces/CommonGUIHelperInterface.h>
#include <examples/SharedMemory/PhysicsCommandProcessorInterface.h>
#include <examples/SharedMemory/SharedMemoryPublic.h>
#include <examples/SharedMemory/plugins/b3PluginContext.h>

#include "world.h"

namespace smartmesh {

namespace {

// PyBullet hands each new world to its helper for graphics, which a client without a window does not use.
struct WorldListener final : DummyGUIHelper {
  std::unique_ptr<BulletWorld> ground = std::make_unique<BulletWorld>();
  void createPhysicsDebugDrawer(btDiscreteDynamicsWorld* world) override { ground->enter(world); }
};

// Never freed: PyBullet calls its helper until the very end of a client.
std::vector<WorldListener*>& listeners() {
  static auto* all = new std::vector<WorldListener*>();
  return *all;
}

BulletWorld& ground_of(const b3PluginContext& context) {
  return *static_cast<WorldListener*>(context.m_userPointer)->ground;
}

}  // namespace

BulletWorld* world_of(int number) {
  if (number < 0 || number >= static_cast<int>(listeners().size())) return nullptr;
  BulletWorld* world = listeners()[number]->ground.get();
  return world->alive() ? world : nullptr;
}

}  // namespace smartmesh

using smartmesh::ground_of;
using smartmesh::listeners;

#define PLUGIN extern "C" __attribute__((visibility("default")))

PLUGIN int initPlugin_smartmesh(b3PluginContext* context) {
  auto* listener = new smartmesh::WorldListener();
  listeners().push_back(listener);
  context->m_userPointer = listener;
  context->m_rpcCommandProcessorInterface->setGuiHelper(listener);
  return SHARED_MEMORY_MAGIC_NUMBER;
}

PLUGIN void exitPlugin_smartmesh(b3PluginContext* context) { ground_of(*context).leave(); }

// Returns the number of the client's world.
PLUGIN int executePluginCommand_smartmesh(b3PluginContext* context, const b3PluginArguments*) {
  for (std::size_t k = 0; k < listeners().size(); ++k)
    if (listeners()[k] == context->m_userPointer) return static_cast<int>(k);
  return -1;
}

// PyBullet tells of bodies that it made or removed, at the end of the command that did so.
PLUGIN int processNotifications_smartmesh(b3PluginContext* context) {
  for (int k = 0; k < context->m_numNotifications; ++k) {
    const b3Notification& it = context->m_notifications[k];
    if (it.m_notificationType == BODY_ADDED) ground_of(*context).note_added();
    if (it.m_notificationType == BODY_REMOVED) ground_of(*context).note_removed(it.m_bodyArgs.m_bodyUniqueId);
  }
  return 0;
}

PLUGIN int preTickPluginCallback_smartmesh(b3PluginContext* context) {
  ground_of(*context).before_step();
  return 0;
}

PLUGIN int postTickPluginCallback_smartmesh(b3PluginContext* context) {
  ground_of(*context).after_step();
  return 0;
}
