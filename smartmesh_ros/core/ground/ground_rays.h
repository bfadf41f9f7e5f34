// Rays onto the ground. Heights of one instant are kept until the ground has moved on.
#pragma once

#include <vector>

#include "ground/ray_grid.h"
#include "ground/tiles.h"

namespace smartmesh {

class GroundRays {
 public:
  // Returns a reader at `time` [s] for `first_hit`, and forgets what has changed.
  GroundReader begin(const Tiles& terrain, double time);

  // Returns what a ray meets first. Rays pass through holes. Where maps overlap, a ray meets the one that it reaches
  // first.
  RayHit first_hit(GroundReader& ground, Ray ray);

 private:
  std::vector<RayTiles> grids_;
  long layout_ = -1, revision_ = -1;
  double instant_ = NONE;
};

}  // namespace smartmesh
