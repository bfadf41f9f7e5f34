#include "bullet/ground_algorithm.h"

#include <new>

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include "bullet/world.h"

namespace smartmesh {

namespace {

constexpr int CONVEX_KINDS[] = {SPHERE_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, CAPSULE_SHAPE_PROXYTYPE,
                                CYLINDER_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE};

class GroundAlgorithm final : public btCollisionAlgorithm {
 public:
  GroundAlgorithm(const btCollisionAlgorithmConstructionInfo& info, BulletWorld* world, bool swapped)
      : btCollisionAlgorithm(info), world_(world), swapped_(swapped) {}
  ~GroundAlgorithm() override {
    for (btPersistentManifold* manifold : {with_ground_, with_soil_})
      if (manifold != nullptr) m_dispatcher->releaseManifold(manifold);
  }

  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override {
    const btCollisionObjectWrapper &body = swapped_ ? *b : *a, &ground = swapped_ ? *a : *b;
    Slot* slot = world_->attached.slot_of(*ground.getCollisionObject());
    const bool is_attached = slot != nullptr && slot->object == body.getCollisionObject();
    const bool has_soil = world_->now.soil != nullptr;
    const btCollisionObject *one = a->getCollisionObject(), *other = b->getCollisionObject();
    if (is_attached && with_ground_ == nullptr) with_ground_ = m_dispatcher->getNewManifold(one, other);
    // In the other order: a saved state of Bullet's has one manifold of two objects.
    if (is_attached && has_soil && with_soil_ == nullptr) with_soil_ = m_dispatcher->getNewManifold(other, one);
    bool found = false;
    if (is_attached) {
      result->setPersistentManifold(with_ground_);
      world_->guarded([&] {
        // A query before the world's first step has no time step.
        world_->narrowphase.touch(*slot, body, *with_ground_, has_soil ? with_soil_ : nullptr,
                                  info.m_timeStep > 0.0 ? info.m_timeStep : world_->now.duration);
        found = true;
      });
    }
    if (with_ground_ != nullptr && !found) with_ground_->setNumContacts(0);
    if (with_soil_ != nullptr && !(found && has_soil)) with_soil_->setNumContacts(0);
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1.0;
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override {
    for (btPersistentManifold* manifold : {with_ground_, with_soil_})
      if (manifold != nullptr) manifolds.push_back(manifold);
  }

 private:
  BulletWorld* world_;
  bool swapped_;
  btPersistentManifold *with_ground_ = nullptr, *with_soil_ = nullptr;
};

// The dispatcher's table of contacts, which only derived classes may write without Bullet's own library.
struct Tables : btCollisionDispatcher {
  auto& of(int kind, int other) { return m_doubleDispatchContactPoints[kind][other]; }
};

Tables& tables_of(const btDiscreteDynamicsWorld& world) {
  return *static_cast<Tables*>(const_cast<btDiscreteDynamicsWorld&>(world).getDispatcher());
}

}  // namespace

btCollisionAlgorithm* GroundAlgorithms::CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                                 const btCollisionObjectWrapper* a,
                                                                 const btCollisionObjectWrapper*) {
  void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(GroundAlgorithm));
  return new (memory) GroundAlgorithm(info, ground_, a->getCollisionShape()->getShapeType() == GROUND_SHAPE_TYPE);
}

void GroundAlgorithms::enter(btDiscreteDynamicsWorld& world) {
  for (int kind : CONVEX_KINDS)
    tables_of(world).of(kind, GROUND_SHAPE_TYPE) = tables_of(world).of(GROUND_SHAPE_TYPE, kind) = this;
}

bool GroundAlgorithms::are_in(const btDiscreteDynamicsWorld& world) const {
  return tables_of(world).of(CONVEX_KINDS[0], GROUND_SHAPE_TYPE) == this;
}

}  // namespace smartmesh
