// The one reader of moving ground: tiles of height maps, the gaps between them, meshes, and what lies near a body.
#pragma once

#include <memory>
#include <vector>

#include "ground/ground_under.h"
#include "ground/tile_reader.h"
#include "map/window.h"
#include "mesh/mesh_reader.h"
#include "mesh/patch.h"

namespace smartmesh {

struct Deck;
struct DeckReader;

// The ground near a body: a height that none of it exceeds [m], -1e300 = no ground, and the middle of its velocities,
// from which none differs by more than `spread` [m/s].
struct NearbyGround {
  double highest = -1e300;
  Vec3 velocity;
  double spread = 0.0;
};

constexpr int NOBODY = -2;

// A map of soil, which other contacts bear: other ground ends at its edges. `map`: null = none. `top` [m]: of a shape,
// infinity over the soil. Its own edges are ground only where they are higher: a lower one bears the shape as all soil
// does. `is_all`: all below the shape is soil.
struct SoilBelow {
  const HeightGrid* map = nullptr;
  double top = INFINITE;
  bool is_all = false;
};

// The ground near a point, and the deck that has it; null = it is beside decks, or there is none.
struct NearPoint : GroundSample {
  const Deck* deck = nullptr;
};

// The height maps, the meshes and the decks of a terrain at one instant; `decks` is null if there are none.
struct GroundReader {
  TileReader tiles;
  std::vector<MeshReader> meshes;
  std::shared_ptr<std::vector<DeckReader>> decks;

  // Returns the highest ground beside decks at (p.x, p.y), of maps not above `top` [m] and of meshes not above `p`.
  GroundSample beside_decks(const Vec3& p, double top);

  // Returns the highest ground over or under `p`, beside the decks that a PyBullet `body` carries. Maps are solid as
  // far down as they are thick [m]. Ground of meshes above `p` counts up to there, and only where there is none below;
  // that of decks as in DeckReader::near.
  NearPoint near(const Vec3& p, double thickness = INFINITE, int body = NOBODY);
  // Returns the highest ground of maps, meshes and decks that is not above `p`, as sensors see it.
  GroundSample below(const Vec3& p);
  GroundSample highest(double x, double y) { return below({x, y, ABOVE_ALL}); }

  // Computes what pays for `count` points or rays.
  void prepare(std::size_t count);
};

// A map that is being corrected, and the instant up to which its corrections were shown before [s].
struct MapCorrection {
  HeightGrid* map;
  double shown;
};

// All tiles of a terrain, or of a deck: the ground as it moves.
class Tiles {
 public:
  // The first height map that has ground at a point counts there. The parts of one mesh join where they abut.
  void set_all(const std::vector<HeightGrid*>& maps, const std::vector<MeshSurface*>& meshes,
               const std::vector<Deck*>& decks = {});
  const std::vector<HeightGrid*>& maps() const { return maps_; }
  const std::vector<MeshSurface*>& meshes() const { return meshes_; }
  const std::vector<Deck*>& decks() const { return decks_; }

  // Fills `patch` with the ground of height maps, or of meshes, beside decks, inside `bounds` at `time` [s], as far as
  // it is in `reach`. Velocities are means over the time `ahead` [s]; zero = they are not read. `soil`: is left out.
  void gather(const Bounds& bounds, double time, double ahead, const Reach& reach, Patch& patch,
              const SoilBelow& soil = {});
  void gather_meshes(const Bounds& bounds, double time, double ahead, const Reach& reach, Patch& patch);

  // Returns a reader at `time` [s], with mean velocities over the time `ahead` [s].
  GroundReader reader(double time, double ahead) const;

  // Returns the ground beside decks that comes under `bounds` within the time `ahead` [s], as it is at `time` [s].
  NearbyGround near(const Bounds& bounds, double time, double ahead);

  // Blends corrections of the maps beside decks in up to `time` [s], and adds those of which something was left.
  void show_corrections(double time, std::vector<MapCorrection>& found);
  // Notes that bodies met the ground up to the instant `time` [s].
  void note_shown(double time);
  // Returns the number of the last change of the tiles or their samples.
  long revision() const;
  // Returns the number of the last change of which tiles there are, beside those of decks.
  long layout() const { return layout_; }
  // Returns true if any height map has a material, also of decks.
  bool has_material() const;
  // Returns the material at (x, y) at `time` [s]: of the nearest sample of the first map that has ground there.
  Material material(double x, double y, double time);
  // Returns true if any ground may move at `time` [s].
  bool moves(double time) const;
  // Finds the ground inside `bounds` at `time` [s], and the blocks of samples there, which are known until there
  // are other tiles.
  void ground_under(const Bounds& bounds, double time, GroundUnder& found);
  void add_ground_under(const Bounds& bounds, double time, GroundUnder& found);
  void blocks_under(const Bounds& bounds, double time, std::vector<BlockUnder>& found) const;
  // Returns the updates so far of some blocks, and of all meshes and decks.
  Updates updates_of(const std::vector<BlockUnder>& blocks, double time) const;

 private:
  // Returns bounds that hold the tiles on both sides of each gap that is bridged inside `bounds`.
  Bounds with_gaps(const Bounds& bounds) const;
  void place_tiles(double time);
  // Finds the maps that have cells under `bounds` at `time` [s], in their order.
  void find_under(const Bounds& bounds, double time);
  void sample_across(const MapAtInstant& finest, const Bounds& bounds, double time, double ahead, const Reach& reach,
                     const SoilBelow& soil, Patch& patch);

  std::vector<HeightGrid*> maps_;
  std::vector<MeshSurface*> meshes_;
  std::vector<Deck*> decks_;
  double widest_cell_ = 0.0;          // [m]
  std::vector<MapAtInstant> placed_;  // as of a time [s] and the last change of any map
  double placed_at_ = 0.0;
  long placed_revision_ = -1;
  std::vector<const MapAtInstant*> under_;  // a body
  Window window_;
  MeshScratch scratch_;
  long layout_ = 0;
};

// Writes the heights (count, points) [m] of the highest ground at a pattern of points (points, 2) [m] in the frame of
// each pose (count, 3), position [m] and yaw [rad], as policies of legged robots observe it; NaN = no ground. There is
// none around a pose whose numbers are larger than `farthest` or not finite.
void scan_heights(GroundReader& ground, const double* poses, std::size_t count, const double* pattern,
                  std::size_t points, double farthest, double* heights);

}  // namespace smartmesh
