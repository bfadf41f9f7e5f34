// Rays onto a moving height map: a traversal of tiles and cells (Amanatides and Woo, *A Fast Voxel Traversal Algorithm
// for Ray Tracing*, 1987).
//
// A ray is followed through the cells of a tile only where it is between the tile's lowest and highest height. In a
// cell the gap between ray and ground is linear on each side of the diagonal, so the ray meets the ground where the gap
// changes its sign. The gap at the end of one facet is the gap at the start of the next, so that no ray slips through
// an edge.
#pragma once

#include "ground/ray_tiles.h"
#include "mesh/mesh_surface.h"

namespace smartmesh {

struct Ray {
  Vec3 from, way;  // `way` has length one
  double range;    // [m]
};

// Returns the first hit of a ray on the map with this `number` among `maps`, from either side. `tiles`: of that map.
RayHit first_hit(const Ray& ray, RayTiles& tiles, TileReader& maps, std::size_t number);

}  // namespace smartmesh
