// Patches of the ground that are shown, and that other simulators get: the cells in the reach of each body.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "ground/tiles.h"
#include "shape/solid.h"

namespace smartmesh {

// A body that may have a patch: its middle and its lowest point [m], and how far from the middle it may touch ground
// until the next message [m]. `always`: it has a patch of the ground below it at any height.
struct ReachingBody {
  Vec3 middle;
  double lowest, radius;
  bool always;
};

// Samples of a square on a height map: its first sample, `side` x `side` samples, each `stride` samples from the next.
struct PatchSquare {
  int tile = -1;  // number of the map; -1 = the body is on none
  int row = 0, column = 0, side = 0, stride = 1;

  bool operator==(const PatchSquare& other) const {
    return tile == other.tile && row == other.row && column == other.column && side == other.side &&
           stride == other.stride;
  }
  int middle() const { return (side - 1) / 2; }
  int last_row() const { return row + (side - 1) * stride; }
  int last_column() const { return column + (side - 1) * stride; }
};

// Returns true if points are the same to the bit; holes are, too.
inline bool are_same(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3)) == 0;
}

// The patch of one body. It is kept, and read anew only if the body came elsewhere or the ground changed.
struct ShownPatch {
  PatchSquare square;  // of the last search
  GridPoint place;     // of the body's middle on the map of the square
  ReachingBody body;

  bool is_shown = false, is_mesh = false;
  int tile = -1;                                       // number of the map, or of the mesh that comes first
  int row = 0, column = 0;                             // of the middle sample; of meshes 0 and the vertex in the middle
  std::vector<Vec3> points;                            // row by row; z is NaN in a hole
  std::vector<std::array<std::int32_t, 3>> triangles;  // all without holes
  std::vector<std::int32_t> near;               // those of the cells, or of a mesh the triangles, that are in reach
  Vec3 linear, angular;                         // motion of the ground at the middle sample [m/s], [rad/s]
  long points_revision = 0, near_revision = 0;  // grow with each change of the points, and of what is near

  int deck = -1;         // number of the deck that it is of; -1 = none
  bool of_mesh = false;  // `tile` is a mesh

  // Height of a body above the ground from which on it has no patch [m], beside what it may fall.
  static constexpr double TOUCHING = 1e-3;
  bool reaches_map() const { return highest >= body.lowest - TOUCHING; }

  // What was read: the square, or the box around the body.
  PatchSquare read;
  Bounds box;
  double highest = -1e300;  // of the points [m]
  std::vector<BlockUnder> blocks;
  std::int64_t updates = -1;
  bool calm = false;
  long near_of = -1;  // revision of the points that `near` is of
};

// The patches of bodies by slot.
class ShownPatches {
 public:
  void set_tiles(const std::vector<HeightGrid*>& maps, const std::vector<MeshSurface*>& meshes);
  void resize(std::size_t slots) { patches_.resize(slots); }
  std::size_t size() const { return patches_.size(); }
  const ShownPatch& operator[](std::size_t slot) const { return patches_[slot]; }

  // Search: finds the cells under the bodies in `slots` on the maps at `time` [s], first on the map of before.
  void search(const std::vector<std::int64_t>& slots, const std::vector<ReachingBody>& bodies, double time);
  // Collect: takes the samples of the patches in `slots`, from the cache while neither body nor ground changed. A body
  // without a triangle in reach has no patch.
  void collect(const std::vector<std::int64_t>& slots, double time);

 private:
  int map_under(const Vec3& p, double radius, int before, std::vector<Tile>& maps) const;
  PatchSquare square_on(int tile, const GridPoint& place, double radius) const;
  void read_map(ShownPatch& patch, TileReader& tiles, double time);
  void read_points(const PatchSquare& square, TileReader& tiles, std::vector<Vec3>& points) const;
  void read_motion(ShownPatch& patch, TileReader& tiles) const;
  bool read_meshes(ShownPatch& patch, double time);
  void find_near(ShownPatch& patch);

  Tiles tiles_;
  std::vector<ShownPatch> patches_;
  std::vector<Vec3> fresh_;
  std::vector<std::int32_t> near_;
  Patch found_;
};

}  // namespace smartmesh
