#include "ground/tiles.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "ground/deck.h"

namespace smartmesh {

namespace {

// Returns true if there is ground at a height [m], and none at an `other` one that is as high; NaN = no ground there.
bool is_above(double height, double other) { return !(height <= other) && !std::isnan(height); }

}  // namespace

GroundSample GroundReader::beside_decks(const Vec3& p, double top) {
  GroundSample found;
  if (const TileFacet here = tiles.at(p.x, p.y, top); here.tile != nullptr) {
    const HeightGrid& grid = *here.tile->grid;
    const GridPoint place = clamped(grid, here.tile->place(p.x, p.y));
    const Clock& clock = grid.clock(static_cast<int>(place.row), static_cast<int>(place.column));
    found = {{here.facet.height, here.tile->velocity(p.x, p.y, here.facet.velocity, tiles.ahead())},
             here.tile->normal(here.facet.per_column, here.facet.per_row),
             tiles.time() - clock.time,
             grid.materials.at(nearest_index(grid, place)).friction};
  }
  for (MeshReader& mesh : meshes)
    if (const GroundSample here = mesh.below(p.x, p.y, p.z); is_above(here.height, found.height)) found = here;
  return found;
}

NearPoint GroundReader::near(const Vec3& p, double thickness, int body) {
  const double top = p.z + thickness;
  NearPoint found{beside_decks(p, top)};
  if (decks != nullptr) {
    for (DeckReader& deck : *decks) {
      if (deck.deck->body == body) continue;
      if (const GroundSample here = deck.near(p); is_above(here.height, found.height)) found = {here, deck.deck};
    }
  }
  return std::isnan(found.height) ? NearPoint{beside_decks({p.x, p.y, top}, top)} : found;
}

GroundSample GroundReader::below(const Vec3& p) {
  GroundSample found = beside_decks(p, p.z);
  if (decks == nullptr) return found;
  for (DeckReader& deck : *decks)
    if (const GroundSample here = deck.below(p); is_above(here.height, found.height)) found = here;
  return found;
}

void GroundReader::prepare(std::size_t count) {
  for (MeshReader& mesh : meshes) mesh.prepare(count);
}

GroundReader Tiles::reader(double time, double ahead) const {
  GroundReader made{{maps_, time, ahead}, {}, {}};
  for (const MeshSurface* mesh : meshes_) made.meshes.emplace_back(*mesh, time, ahead);
  if (!decks_.empty()) made.decks = std::make_shared<std::vector<DeckReader>>();
  for (const Deck* deck : decks_) made.decks->emplace_back(*deck, time);
  return made;
}

Bounds Tiles::with_gaps(const Bounds& bounds) const { return maps_.size() > 1 ? bounds.grown(widest_cell_) : bounds; }

void Tiles::set_all(const std::vector<HeightGrid*>& maps, const std::vector<MeshSurface*>& meshes,
                    const std::vector<Deck*>& decks) {
  maps_ = maps;
  meshes_ = meshes;
  decks_ = decks;
  widest_cell_ = 0.0;
  for (const HeightGrid* grid : maps_) widest_cell_ = std::max(widest_cell_, grid->resolution);
  layout_ = next_revision();
  placed_revision_ = -1;
}

void Tiles::show_corrections(double time, std::vector<MapCorrection>& found) {
  for (HeightGrid* map : maps_) {
    if (map->mode != Mode::Correct) continue;
    const double shown = map->shown;
    if (shown < map->settled) found.push_back({map, shown});
    map->show(std::isinf(shown) ? time : std::max(shown, time));
  }
}

void Tiles::note_shown(double time) {
  for (HeightGrid* grid : maps_)
    if (grid->mode != Mode::Correct) grid->shown = time;
  for (MeshSurface* mesh : meshes_) mesh->shown = time;
  for (Deck* deck : decks_) deck->tiles.note_shown(time);
}

long Tiles::revision() const {
  long last = layout_;
  for (const HeightGrid* grid : maps_) last = std::max(last, grid->revision);
  for (const MeshSurface* mesh : meshes_) last = std::max(last, mesh->revision);
  for (const Deck* deck : decks_) last = std::max({last, deck->tiles.revision(), deck->motion.revision()});
  return last;
}

bool Tiles::has_material() const {
  return std::any_of(maps_.begin(), maps_.end(), [](const HeightGrid* grid) { return grid->materials.is_given(); }) ||
         std::any_of(decks_.begin(), decks_.end(), [](const Deck* deck) { return deck->tiles.has_material(); });
}

bool Tiles::moves(double time) const {
  return std::any_of(maps_.begin(), maps_.end(), [&](const HeightGrid* grid) { return grid->moves(time); }) ||
         std::any_of(meshes_.begin(), meshes_.end(), [&](const MeshSurface* mesh) { return mesh->moves(time); }) ||
         std::any_of(decks_.begin(), decks_.end(),
                     [&](const Deck* deck) { return deck->motion.moves(time) || deck->tiles.moves(time); });
}

void Tiles::ground_under(const Bounds& bounds, double time, GroundUnder& found) {
  found.clear();
  add_ground_under(bounds, time, found);
}

void Tiles::add_ground_under(const Bounds& bounds, double time, GroundUnder& found) {
  const Bounds grown = with_gaps(bounds);
  for (const HeightGrid* grid : maps_) smartmesh::add_ground_under(*grid, time, grown, found);
  Patch near;
  gather_meshes(bounds, time, 0.0, Everything{}, near);
  for (const Vec3& p : near.points) found.vertices.insert(found.vertices.end(), {p.x, p.y, p.z});
  for (Deck* deck : decks_) deck->add_ground_under(bounds, time, found);
}

void Tiles::blocks_under(const Bounds& bounds, double time, std::vector<BlockUnder>& found) const {
  found.clear();
  const Bounds grown = with_gaps(bounds);
  for (const HeightGrid* grid : maps_) add_blocks_under(*grid, time, grown, found);
}

Updates Tiles::updates_of(const std::vector<BlockUnder>& blocks, double time) const {
  Updates found;
  for (const BlockUnder& block : blocks) found.add(block, time);
  for (const MeshSurface* mesh : meshes_) found.count += mesh->revision, found.moves |= mesh->moves(time);
  for (const Deck* deck : decks_) {
    found.count += deck->tiles.revision() + deck->motion.revision();
    found.moves |= deck->motion.moves(time) || deck->tiles.moves(time);
  }
  return found;
}

void Tiles::gather_meshes(const Bounds& bounds, double time, double ahead, const Reach& reach, Patch& patch) {
  patch.clear();
  patch.is_mesh = true;
  for (std::size_t k = 0; k < meshes_.size(); ++k)
    meshes_[k]->gather(bounds, time, ahead, reach, static_cast<int>(k), scratch_, patch);
}

void Tiles::place_tiles(double time) {
  const long now = last_revision();
  if (time == placed_at_ && now == placed_revision_) return;
  placed_at_ = time, placed_revision_ = now;
  placed_.clear();
  for (HeightGrid* grid : maps_) {
    const GridPose pose = grid->pose_at(time);
    placed_.push_back({grid, pose, {}});
    for (const double row : {0.0, grid->rows - 1.0})
      for (const double column : {0.0, grid->columns - 1.0})
        placed_.back().bounds.add(pose.point({row, column}, grid->resolution));
  }
}

Material Tiles::material(double x, double y, double time) {
  place_tiles(time);
  for (const MapAtInstant& map : placed_) {
    const HeightGrid& grid = *map.grid;
    const GridPoint place = to_grid(map.pose, grid.resolution, x, y);
    if (!is_on(grid, place)) continue;
    const std::size_t nearest = nearest_index(grid, clamped(grid, place));
    if (!std::isnan(grid.heights[nearest])) return grid.materials.at(nearest);
  }
  return {};
}

void Tiles::find_under(const Bounds& bounds, double time) {
  place_tiles(time);
  under_.clear();
  for (MapAtInstant& map : placed_) {
    const bool apart = map.bounds.low.x > bounds.high.x || map.bounds.high.x < bounds.low.x ||
                       map.bounds.low.y > bounds.high.y || map.bounds.high.y < bounds.low.y;
    if (!apart && !(map.cells = cells_under(*map.grid, map.pose, bounds)).empty()) under_.push_back(&map);
  }
}

void Tiles::gather(const Bounds& bounds, double time, double ahead, const Reach& reach, Patch& patch,
                   const SoilBelow& soil) {
  patch.clear();
  if (soil.is_all) return;
  find_under(with_gaps(bounds), time);
  if (under_.empty()) return;
  if (under_.size() > 1) {
    const MapAtInstant& finest = **std::min_element(
        under_.begin(), under_.end(),
        [](const MapAtInstant* a, const MapAtInstant* b) { return a->grid->resolution < b->grid->resolution; });
    sample_across(finest, bounds, time, ahead, reach, soil, patch);
    return;
  }
  const MapAtInstant& map = *under_[0];
  const CellRange cells = cells_under(*map.grid, map.pose, bounds);
  if (cells.empty()) return;
  read_window(*map.grid, map.pose, cells, time, ahead, window_);
  const double lowest = map.grid == soil.map ? soil.top : bounds.low.z;
  if (window_.highest() >= lowest) add_cells(window_, cells.top - 1, cells.left - 1, reach, patch);
}

// Samples the tiles under a body on the lattice of the finest one, which may go on beyond its edge. At the edges of
// soil the height is that of the other tiles: a body that sank meets their sides. At soil that is higher than the body,
// it is the soil's.
void Tiles::sample_across(const MapAtInstant& finest, const Bounds& bounds, double time, double ahead,
                          const Reach& reach, const SoilBelow& soil, Patch& patch) {
  Bounds here;  // where there are tiles
  for (const MapAtInstant* map : under_) here.add(map->bounds.low), here.add(map->bounds.high);
  const double resolution = finest.grid->resolution;
  const auto [low, high] = extent_of(finest.pose, resolution, bounds.common(here));
  const double top = std::floor(low.row) - 1.0, left = std::floor(low.column) - 1.0;
  window_.rows = static_cast<int>(std::ceil(high.row) - top) + 2;
  window_.columns = static_cast<int>(std::ceil(high.column) - left) + 2;
  window_.resolution = resolution;
  window_.pose = finest.pose.from({top, left}, resolution);
  window_.heights.clear(), window_.rises.clear(), window_.slides.clear();
  window_.ahead = ahead;
  TileReader tiles(under_, widest_cell_, time, ahead > 0.0 ? ahead : INSTANT);
  const auto of_soil =
      std::find_if(under_.begin(), under_.end(), [&](const MapAtInstant* map) { return map->grid == soil.map; });
  const bool has_soil = of_soil != under_.end();
  std::vector<const MapAtInstant*> others;
  if (has_soil) std::remove_copy(under_.begin(), under_.end(), std::back_inserter(others), *of_soil);
  TileReader beside(others, widest_cell_, time, ahead > 0.0 ? ahead : INSTANT);
  const auto sample = [&](const Vec3& p) -> GroundPoint {
    if (!has_soil) return tiles.sample(p.x, p.y);
    if (is_ground_around(*soil.map, (*of_soil)->pose, p, AT_EDGE)) return {};
    const GroundPoint ground = tiles.sample(p.x, p.y), other = beside.sample(p.x, p.y);
    const bool is_others = ground.height <= soil.top ? !std::isnan(other.height) : other.height > ground.height;
    return is_others ? other : ground;
  };
  for (int r = 0; r < window_.rows; ++r) {
    for (int c = 0; c < window_.columns; ++c) {
      const Vec3 p = window_.pose.point({static_cast<double>(r), static_cast<double>(c)}, window_.resolution);
      const GroundPoint ground = sample(p);
      window_.heights.push_back(ground.height);
      if (!(ahead > 0.0)) continue;
      window_.slides.push_back({ground.velocity.x, ground.velocity.y, 0.0});
      window_.rises.push_back(ground.velocity.z * ahead);
    }
  }
  add_cells(window_, static_cast<long>(top), static_cast<long>(left), reach, patch);
}

NearbyGround Tiles::near(const Bounds& bounds, double time, double ahead) {
  NearbyGround found;
  Bounds speeds;
  const Vec3 middle = (bounds.low + bounds.high) * 0.5;
  place_tiles(time);
  double comes = 0.0;  // ground that slides [m]
  for (const MapAtInstant& map : placed_) {
    if (!map.pose.slides()) continue;
    const Vec3 slide = map.pose.slide(middle.x, middle.y);
    const double speed = std::hypot(slide.x, slide.y) + std::abs(slide.z) * norm(bounds.high - middle);
    comes = std::max(comes, speed * ahead);
  }
  const Bounds grown = with_gaps(bounds).grown(comes);
  find_under(grown, time);
  for (const MapAtInstant* map : under_) {
    read_window(*map->grid, map->pose, map->cells, time, ahead, window_);
    const double highest = window_.highest();
    found.highest = std::max(found.highest, highest);
    if (!window_.moves() && highest > NearbyGround{}.highest) speeds.add({});
    for (int r = 0; window_.moves() && r < window_.rows; ++r)
      for (int c = 0; c < window_.columns; ++c)
        if (!std::isnan(window_.at(r, c))) speeds.add(window_.velocity(r, c));
  }
  if (!meshes_.empty()) found.highest = 1e300;  // not worth a search of its own
  if (ahead > 0.0)
    for (const MeshSurface* mesh : meshes_) mesh->add_velocities(bounds, time, ahead, scratch_, speeds);
  if (!(speeds.low.x <= speeds.high.x)) return found;
  found.velocity = (speeds.low + speeds.high) * 0.5;
  if (under_.size() == 1 && under_[0]->pose.spin != 0.0) {  // its samples are not around the middle
    const Vec3 slide = under_[0]->pose.mean_slide(middle.x, middle.y, ahead);
    found.velocity = {slide.x, slide.y, found.velocity.z};
  }
  found.spread = std::max(norm(speeds.high - found.velocity), norm(speeds.low - found.velocity));
  return found;
}

}  // namespace smartmesh
