// What is impossible in bodies that another world describes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace smartmesh {

// In the order of INVALID in world/state_table.py, which has the words for them.
enum class Fault : int { NotFinite, Orientation, Position, Velocity, Spin, Kind, Size, Centre, Radius, Mass, None };

// Described bodies: `states` (count, 13), bounding `radii` [m], `kinds`, `dimensions` (count, 3) [m], `centres` (count,
// 3) relative to the centres of mass [m], and `masses` [kg]; see StateTable in world/state_table.py.
struct DescribedBodies {
  const double *states, *radii, *dimensions, *centres, *masses;
  const std::uint8_t* kinds;
  std::size_t count;
};

// Largest coordinate [m], speed [m/s], spin [rad/s] and error of a quaternion's length; least and largest size [m] and
// mass [kg]. `dimensions`: number of them of each kind; 0 = there is no such kind.
struct BodyLimits {
  double farthest, fastest, fastest_spin, slack, least_size, largest_size, least_mass, largest_mass;
  std::vector<std::int64_t> dimensions;
};

// Returns the first fault of a body, None if it is possible.
Fault fault_of(const DescribedBodies& bodies, std::size_t body, const BodyLimits& limits);

}  // namespace smartmesh
