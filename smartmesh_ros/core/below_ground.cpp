#include "below_ground.h"

#include <cmath>

namespace smartmesh {

Lift lift_out(SurfaceReader& surface, const BodySolid& body) {
  const Vec3 middle = body.whole.centre;
  if (!std::isfinite(middle.x + middle.y + middle.z)) return {};
  GroundPoint ground = surface.at(middle.x, middle.y, middle.z, middle.z);
  if (std::isnan(ground.height)) ground = surface.at(middle.x, middle.y, ABOVE_ALL, middle.z);
  if (!(middle.z < ground.height)) return {};
  return {true, ground.height - body.lowest(), ground.velocity.z};
}

}  // namespace smartmesh
