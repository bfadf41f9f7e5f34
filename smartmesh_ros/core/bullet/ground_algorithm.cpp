#include "ground_algorithm.h"

#include <map>
#include <memory>
#include <new>

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include "world.h"

namespace smartmesh {

namespace {

constexpr int CONVEX_KINDS[] = {SPHERE_SHAPE_PROXYTYPE, BOX_SHAPE_PROXYTYPE, CAPSULE_SHAPE_PROXYTYPE,
                                CYLINDER_SHAPE_PROXYTYPE, CONVEX_HULL_SHAPE_PROXYTYPE};

class GroundAlgorithm final : public btCollisionAlgorithm {
 public:
  GroundAlgorithm(const btCollisionAlgorithmConstructionInfo& info, BulletWorld* world, bool swapped)
      : btCollisionAlgorithm(info), world_(world), swapped_(swapped) {}
  ~GroundAlgorithm() override {
    if (manifold_ != nullptr) m_dispatcher->releaseManifold(manifold_);
  }

  void processCollision(const btCollisionObjectWrapper* a, const btCollisionObjectWrapper* b,
                        const btDispatcherInfo& info, btManifoldResult* result) override {
    if (manifold_ == nullptr) manifold_ = m_dispatcher->getNewManifold(a->getCollisionObject(), b->getCollisionObject());
    result->setPersistentManifold(manifold_);
    world_->touch(swapped_ ? *b : *a, swapped_ ? *a : *b, *manifold_, info.m_timeStep);
  }

  btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                 btManifoldResult*) override {
    return 1.0;
  }
  void getAllContactManifolds(btManifoldArray& manifolds) override {
    if (manifold_ != nullptr) manifolds.push_back(manifold_);
  }

 private:
  BulletWorld* world_;
  bool swapped_;
  btPersistentManifold* manifold_ = nullptr;
};

struct Create final : btCollisionAlgorithmCreateFunc {
  Create(BulletWorld* of, bool is_swapped) : world(of) { m_swapped = is_swapped; }
  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper*,
                                                 const btCollisionObjectWrapper*) override {
    void* memory = info.m_dispatcher1->allocateCollisionAlgorithm(sizeof(GroundAlgorithm));
    return new (memory) GroundAlgorithm(info, world, m_swapped);
  }
  BulletWorld* world;
};

// The dispatcher's table of contacts, which only derived classes may write without Bullet's own library.
struct Tables : btCollisionDispatcher {
  void set(int kind, Create* one, Create* other) {
    m_doubleDispatchContactPoints[kind][GROUND_SHAPE_TYPE] = one;
    m_doubleDispatchContactPoints[GROUND_SHAPE_TYPE][kind] = other;
  }
};

// Both ways round, for each world; they must live as long as PyBullet's world.
std::map<BulletWorld*, std::unique_ptr<Create>> straight, swapped;

}  // namespace

void register_algorithm(btDiscreteDynamicsWorld& world, BulletWorld* ground) {
  auto& one = straight[ground];
  auto& other = swapped[ground];
  if (one == nullptr) {
    one = std::make_unique<Create>(ground, false);
    other = std::make_unique<Create>(ground, true);
  }
  auto& tables = *static_cast<Tables*>(world.getDispatcher());
  for (int kind : CONVEX_KINDS) tables.set(kind, one.get(), other.get());
}

}  // namespace smartmesh
