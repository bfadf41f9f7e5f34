// Bullet's collision algorithm between convex shapes and the ground.
#pragma once

#include <memory>

class btDiscreteDynamicsWorld;

namespace smartmesh {

class BulletWorld;
struct CreateGroundAlgorithm;

// Lets the dispatcher of a Bullet world ask a ground for contacts with its proxies. Must live as long as that world.
class GroundAlgorithms {
 public:
  explicit GroundAlgorithms(BulletWorld* ground);
  ~GroundAlgorithms();
  void enter(btDiscreteDynamicsWorld& world) const;
  bool are_in(const btDiscreteDynamicsWorld& world) const;

 private:
  std::unique_ptr<CreateGroundAlgorithm> straight_, swapped_;  // body first, ground first
};

}  // namespace smartmesh
