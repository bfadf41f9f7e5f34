#include "below_ground.h"

#include <cmath>

namespace smartmesh {

Lift lift_out(const Surface& surface, const BodySolid& body, double time) {
  const Vec3 middle = body.whole.centre;
  if (!std::isfinite(middle.x + middle.y + middle.z)) return {};
  GroundPoint ground = surface.at(middle.x, middle.y, time, INSTANT, middle.z);
  if (std::isnan(ground.height)) ground = surface.at(middle.x, middle.y, time, INSTANT);
  if (!(middle.z < ground.height)) return {};
  return {true, ground.height - body.lowest(), ground.velocity};
}

}  // namespace smartmesh
