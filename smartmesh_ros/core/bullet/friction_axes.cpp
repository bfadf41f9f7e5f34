#include "bullet/friction_axes.h"

#include <cmath>
#include <utility>

#include <BulletCollision/NarrowPhaseCollision/btManifoldPoint.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

namespace smartmesh {

namespace {

// Share of the most friction below which a contact holds. Solvers reach all of it within rounding; that of soil changes
// from step to step.
constexpr double MOST_HELD = 0.9;

using Row = btMultiBodySolverConstraint;
using Data = btMultiBodyJacobianData;

// The solver's rows of friction, which only derived classes may turn.
struct Solver : btMultiBodyConstraintSolver {
  btMultiBodyConstraintArray& friction() { return m_multiBodyFrictionContactConstraints; }
  btMultiBodyConstraintArray& rolling() { return m_multiBodyTorsionalFrictionContactConstraints; }
};

// A rotation by an angle, in the plane of two values.
struct Turn {
  double cosine, sine;

  template <class Value>
  void of(Value& one, Value& other) const {
    const Value before = one;
    one = before * cosine + other * sine, other = other * cosine - before * sine;
  }
  void of_dofs(btAlignedObjectArray<btScalar>& values, int one, int other, int count) const {
    for (int k = 0; k < count; ++k) of(values[one + k], values[other + k]);
  }
};

int dofs(const btMultiBody& robot) { return robot.getNumDofs() + 6; }

// Returns the speed along a row that an impulse along it makes, of a robot or of a body [1/kg].
double response(const Data& data, const btMultiBody& robot, int row) {
  double sum = 0.0;
  for (int k = row; k < row + dofs(robot); ++k) sum += data.m_jacobians[k] * data.m_deltaVelocitiesUnitImpulse[k];
  return sum;
}
double response(const btSolverBody& body, const btVector3& along, const btVector3& turns, const btVector3& turned) {
  return along.dot(along * body.internalGetInvMass()) + turns.dot(turned);
}
double response(const Data& data, const Row& row) {
  const auto& bodies = *data.m_solverBodyPool;
  const double a = row.m_multiBodyA != nullptr ? response(data, *row.m_multiBodyA, row.m_jacAindex)
                                               : response(bodies[row.m_solverBodyIdA], row.m_contactNormal1,
                                                          row.m_relpos1CrossNormal, row.m_angularComponentA);
  const double b = row.m_multiBodyB != nullptr ? response(data, *row.m_multiBodyB, row.m_jacBindex)
                                               : response(bodies[row.m_solverBodyIdB], row.m_contactNormal2,
                                                          row.m_relpos2CrossNormal, row.m_angularComponentB);
  return a + b;
}

// Returns true if friction held a contact in the last step, with less than its most.
bool holds(const btManifoldPoint& point) {
  const double held = std::hypot(point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2);
  return held < MOST_HELD * point.m_combinedFriction * point.m_appliedImpulse;
}

// Returns the speed that a row without impulses would leave [m/s].
double speed_of(const Row& row) { return row.m_jacDiagABInv > 0.0 ? row.m_rhs / row.m_jacDiagABInv : 0.0; }

void turn_rows(const Turn& turn, Row& one, Row& other, Data& data, double softness, double relaxation) {
  double speed = speed_of(one), other_speed = speed_of(other);
  turn.of(speed, other_speed);
  for (auto* values : {&data.m_jacobians, &data.m_deltaVelocitiesUnitImpulse}) {
    if (one.m_multiBodyA != nullptr) turn.of_dofs(*values, one.m_jacAindex, other.m_jacAindex, dofs(*one.m_multiBodyA));
    if (one.m_multiBodyB != nullptr) turn.of_dofs(*values, one.m_jacBindex, other.m_jacBindex, dofs(*one.m_multiBodyB));
  }
  turn.of(one.m_contactNormal1, other.m_contactNormal1), turn.of(one.m_contactNormal2, other.m_contactNormal2);
  turn.of(one.m_relpos1CrossNormal, other.m_relpos1CrossNormal);
  turn.of(one.m_relpos2CrossNormal, other.m_relpos2CrossNormal);
  if (one.m_multiBodyA == nullptr) turn.of(one.m_angularComponentA, other.m_angularComponentA);
  if (one.m_multiBodyB == nullptr) turn.of(one.m_angularComponentB, other.m_angularComponentB);
  turn.of(one.m_appliedImpulse, other.m_appliedImpulse);
  for (auto [row, of_row] : {std::pair(&one, speed), std::pair(&other, other_speed)}) {
    const double speeds = response(data, *row) + softness;  // Bullet leaves alone what nothing moves
    row->m_jacDiagABInv = speeds > SIMD_EPSILON ? relaxation / speeds : 0.0;
    row->m_rhs = of_row * row->m_jacDiagABInv, row->m_cfm = softness * row->m_jacDiagABInv;
  }
}

}  // namespace

FrictionAxes* FrictionAxes::enter(btCollisionObject& link, btDiscreteDynamicsWorld& world) {
  const auto* collider = btMultiBodyLinkCollider::upcast(&link);
  if (collider == nullptr) return nullptr;
  auto& robots = static_cast<btMultiBodyDynamicsWorld&>(world);
  auto* axes = new FrictionAxes(*collider->m_multiBody, robots);
  robots.addMultiBodyConstraint(axes);
  return axes;
}

void FrictionAxes::leave(FrictionAxes* axes) {
  if (axes == nullptr) return;
  axes->world_.removeMultiBodyConstraint(axes);
  delete axes;
}

void FrictionAxes::createConstraintRows(btMultiBodyConstraintArray&, btMultiBodyJacobianData& data,
                                        const btContactSolverInfo& solver) {
  if (!(solver.m_solverMode & SOLVER_USE_2_FRICTION_DIRECTIONS)) return;
  Solver& found = static_cast<Solver&>(*world_.getConstraintSolver());
  for (const bool slides : {true, false}) {
    btMultiBodyConstraintArray& rows = slides ? found.friction() : found.rolling();
    const double softness = slides ? solver.m_frictionCFM / solver.m_timeStep : solver.m_globalCfm;
    for (int k = 0; k + 1 < rows.size(); ++k) {
      if (rows[k].m_multiBodyA != m_bodyA && rows[k].m_multiBodyB != m_bodyA) continue;
      if (rows[k].m_originalContactPoint != rows[k + 1].m_originalContactPoint) continue;
      btManifoldPoint& point = *static_cast<btManifoldPoint*>(rows[k].m_originalContactPoint);
      if (slides && holds(point)) continue;
      const double one = speed_of(rows[k]), other = speed_of(rows[k + 1]), speed = std::hypot(one, other);
      if (!(speed > 0.0)) continue;
      const Turn turn{one / speed, other / speed};
      if (slides) turn.of(point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
      turn_rows(turn, rows[k], rows[k + 1], data, softness, solver.m_sor);
    }
  }
}

int FrictionAxes::getIslandIdA() const {
  const btMultiBodyLinkCollider* base = m_bodyA->getBaseCollider();
  int island = base != nullptr ? base->getIslandTag() : -1;
  for (int k = 0; island < 0 && k < m_bodyA->getNumLinks(); ++k)
    if (const auto* link = m_bodyA->getLinkCollider(k); link != nullptr) island = link->getIslandTag();
  return island;
}

}  // namespace smartmesh
