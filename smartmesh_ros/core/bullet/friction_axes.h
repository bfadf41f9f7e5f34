// Axes of the friction of robots, of which Bullet's solver has but one pair: near the world's x and y.
#pragma once

#include <BulletDynamics/Featherstone/btMultiBodyConstraint.h>

class btCollisionObject;
class btDiscreteDynamicsWorld;
class btManifoldPoint;
class btMultiBodyDynamicsWorld;

namespace smartmesh {

// Turns the two rows of friction of each contact of a robot that slips into the slip, on whatever it touches, and the
// two of friction against rolling into the way it rolls. The solver limits their sum by a cone, but weighs the slip
// along each row by the mass that it meets there: a wheel that spins between the rows would be held less, and pushed to
// its side. It is a constraint without rows of its own, since the solver asks all constraints of a robot for theirs
// once the contacts have theirs. The world owns it, as its other constraints.
class FrictionAxes final : public btMultiBodyConstraint {
 public:
  // Adds them to a world for the robot of a link; null if the object is no link. PyBullet deletes them with the robot.
  static FrictionAxes* enter(btCollisionObject& link, btDiscreteDynamicsWorld& world);
  // Takes them out of the world, if there are any, and deletes them.
  static void leave(FrictionAxes* axes);

  void createConstraintRows(btMultiBodyConstraintArray&, btMultiBodyJacobianData& data,
                            const btContactSolverInfo& solver) override;
  int getIslandIdA() const override;
  int getIslandIdB() const override { return getIslandIdA(); }
  void finalizeMultiDof() override {}
  void debugDraw(btIDebugDraw*) override {}

 private:
  FrictionAxes(btMultiBody& robot, btMultiBodyDynamicsWorld& world)
      : btMultiBodyConstraint(&robot, &robot, -1, -1, 0, false, MAX_MULTIBODY_CONSTRAINT_TYPE), world_(world) {}

  btMultiBodyDynamicsWorld& world_;
};

}  // namespace smartmesh
