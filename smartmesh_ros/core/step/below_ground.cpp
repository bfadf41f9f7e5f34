#include "step/below_ground.h"

#include <cmath>
#include <limits>

namespace smartmesh {

GroundPoint ground_above(GroundReader& reader, const Vec3& middle, int body) {
  const GroundPoint none{std::numeric_limits<double>::quiet_NaN(), {}};
  if (!std::isfinite(middle.x + middle.y + middle.z)) return none;
  GroundPoint ground = reader.at(middle.x, middle.y, middle.z, middle.z, body);
  if (std::isnan(ground.height)) ground = reader.at(middle.x, middle.y, ABOVE_ALL, middle.z, body);
  return middle.z < ground.height ? ground : none;
}

}  // namespace smartmesh
