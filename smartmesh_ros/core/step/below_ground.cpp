#include "step/below_ground.h"

#include <cmath>
#include <limits>

namespace smartmesh {

GroundPoint ground_above(GroundReader& reader, const Vec3& inside, int body) {
  const GroundPoint none{std::numeric_limits<double>::quiet_NaN(), {}};
  if (!std::isfinite(inside.x + inside.y + inside.z)) return none;
  GroundPoint ground = reader.at(inside.x, inside.y, inside.z, inside.z, body);
  if (std::isnan(ground.height)) ground = reader.at(inside.x, inside.y, ABOVE_ALL, inside.z, body);
  return inside.z < ground.height ? ground : none;
}

}  // namespace smartmesh
