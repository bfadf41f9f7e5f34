#include "ground/ground_rays.h"

#include <algorithm>
#include <cmath>

#include "ground/deck.h"

namespace smartmesh {

namespace {

// Most samples by which the lattice of a map goes on beyond its edge. Gaps wider than that, beside maps that are so
// much coarser, are open to rays in their middle.
constexpr double MOST_PADDING = 1024.0;
// Share of a cell that the widest gap is longer than the padding, against rounding.
constexpr double ROUNDING = 1e-5;
constexpr double AT_REST = -INFINITE;  // instant of ground that does not move

}  // namespace

GroundReader GroundRays::begin(const Tiles& terrain, double time) {
  GroundReader ground = terrain.reader(time, INSTANT);
  TileReader& maps = ground.tiles;
  const long revision = terrain.revision();
  const double instant = terrain.moves(time) ? time : AT_REST;
  if (layout_ != terrain.layout()) {
    grids_.clear();
    for (const Tile& tile : maps.tiles()) {
      const double cells = std::ceil((1.0 - ROUNDING) * maps.widest_gap() / tile.grid->resolution);
      grids_.emplace_back(*tile.grid, maps.tiles().size() > 1 ? static_cast<int>(std::min(cells, MOST_PADDING)) : 0);
    }
  } else if (revision != revision_ || !(instant == instant_)) {
    for (RayTiles& tiles : grids_) tiles.forget();
  }
  layout_ = terrain.layout(), revision_ = revision, instant_ = instant;
  return ground;
}

RayHit GroundRays::first_hit(GroundReader& ground, Ray ray) {
  RayHit best;
  const auto take = [&](const RayHit& hit) {
    if (hit.distance < best.distance) best = hit, ray.range = std::min(ray.range, hit.distance);
  };
  for (std::size_t k = 0; k < grids_.size(); ++k) take(smartmesh::first_hit(ray, grids_[k], ground.tiles, k));
  for (const MeshReader& mesh : ground.meshes) take(mesh.first_hit(ray.from, ray.way, ray.range));
  if (ground.decks == nullptr) return best;
  for (DeckReader& deck : *ground.decks) take(deck.first_hit(ray));
  return best;
}

}  // namespace smartmesh
