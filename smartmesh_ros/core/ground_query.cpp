#include "ground_query.h"

namespace smartmesh {

GroundSample ground_below(SurfaceReader& reader, const Vec3& p) {
  GroundSample found;
  if (const TileFacet here = reader.tiles.at(p.x, p.y, p.z); here.tile != nullptr) {
    const HeightGrid& grid = *here.tile->grid;
    const GridPoint place = clamped(grid, here.tile->place(p.x, p.y));
    const Vec3 slide = here.tile->pose.slide(p.x, p.y);
    const Clock& clock = grid.clock(static_cast<int>(place.row), static_cast<int>(place.column));
    found = {here.facet.height, here.tile->normal(here.facet.per_column, here.facet.per_row),
             {slide.x, slide.y, here.facet.velocity}, reader.tiles.time() - clock.time};
  }
  const MeshReader* mesh = nullptr;
  const MeshPoint ground = reader.meshes_at(p.x, p.y, p.z, mesh);
  if (mesh != nullptr && !(ground.height <= found.height))
    found = {ground.height, ground.normal, ground.velocity, mesh->age()};
  return found;
}

}  // namespace smartmesh
