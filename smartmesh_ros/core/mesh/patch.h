// The ground near one body as a small triangle mesh with its neighbourhoods: what contacts are worked out from.
#pragma once

#include <vector>

#include "map/window.h"
#include "math/vec3.h"

namespace smartmesh {

// Triangle of a patch, counterclockwise seen from its outside. `normal`: unit, outwards; of meshes to either side.
struct Facet {
  int corner[3];
  Vec3 normal;
  double size = 0.0;  // of meshes: distance of the farthest corner from the first [m]
};

// Convex edge of a patch. `opposite`: the third corners of the facets at both sides; -1 = no facet. Where more than two
// facets of a mesh meet, the outermost two.
struct Edge {
  int end[2];
  int opposite[2];
  Vec3 outward;  // between the directions from which it is touched, not of unit length
};

// A point of a patch where the ground is convex, and its neighbours.
struct Peak {
  int point;
  int first, count;  // of its neighbours in `Patch::neighbours`
};

// Cells that hold the features of a patch, row by row from the corner `pose`. The features of cell k are those from
// `facets[k]` to `facets[k + 1] - 1`, and likewise for edges and peaks, which belong to the cell that they start in. An
// edge may end in the next row or column. No cells: the patch is not divided.
struct PatchCells {
  GridPose pose;
  double resolution = 1.0;
  int rows = 0, columns = 0;
  std::vector<int> facets, edges, peaks;

  // Returns the cells that a rectangle of +-`half_x`, +-`half_y` [m] around (x, y) meets.
  CellRange near(double x, double y, double half_x, double half_y) const;
  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * columns + column; }
};

// Motion of the ground at a point: velocity there [m/s], and angular velocity of its facet [rad/s].
struct GroundMotion {
  Vec3 velocity, angular;
};

// Names of a mesh's points begin with the number of the mesh, in bits from this one on.
constexpr int MESHES_NAMED = 40;

struct Patch {
  bool is_mesh = false;  // facets are touched from both sides; else what is under them is below the ground
  PatchCells cells;
  std::vector<Vec3> points;
  std::vector<Vec3> velocities;  // of the points [m/s]; empty: none moves
  std::vector<Facet> facets;
  std::vector<Edge> edges;
  std::vector<Peak> peaks;
  std::vector<int> neighbours;
  std::vector<long> names;  // of points, equal from step to step; edges and facets are named by their points

  double highest = 0.0;    // of the points [m]
  double steepest = -1.0;  // least upward component of the normals beside the convex edges
  std::vector<int>
      index;  // of the samples of a window in `points`, then of the points below them, while cells are added
  std::vector<char> active;

  // Makes all features one cell, if they are not divided, and finds the highest point.
  void finish();
  // Returns the velocity of the ground at a point of it, by the facet nearest to the point [m/s].
  Vec3 velocity_at(const Vec3& p) const;
  // Returns the angular velocity of the facet nearest to a point; on edges and corners the mean of those there [rad/s].
  Vec3 angular_velocity_at(const Vec3& p) const;
  // Returns the number of the mesh that a facet belongs to, from 1, 0 = height maps.
  long mesh_of(const Facet& facet) const { return is_mesh ? names[facet.corner[0]] >> MESHES_NAMED : 0; }
  // Returns the facet nearest to a point, and the weights of its corners there; null: there is none.
  const Facet* nearest_facet(const Vec3& p, double (&shares)[3]) const;
  // Returns the angular velocity of a facet [rad/s].
  Vec3 angular_velocity(const Facet& facet) const;
  // Returns the mean angular velocity of the facets that a point lies on, else that of the nearest [rad/s].
  Vec3 angular_velocity_around(const Vec3& p, const Facet& nearest) const;
  // Returns by how much the ends of an edge move apart, over its length, a vector [1/s].
  Vec3 turn_of(const Edge& edge) const;
  void clear() {
    cells.rows = cells.columns = 0;
    steepest = -1.0;
    points.clear(), velocities.clear(), facets.clear(), edges.clear(), peaks.clear(), neighbours.clear(), names.clear();
  }
};

// Decides whether a part of the ground may be touched: a ball around `centre` that contains it.
struct Reach {
  virtual bool touches(const Vec3& centre, double radius) const = 0;

  // Returns true if no point of a box may be touched, as far as a quick test tells.
  virtual bool is_clear_of(const Bounds& box) const = 0;

  // Returns true if an edge at `p` may be touched from the directions between the outward normals `one` and `other` of
  // its facets: the centre of what touches is at one of these sides.
  virtual bool is_outside(const Vec3& p, const Vec3& one, const Vec3& other) const = 0;

  // Returns the height down to which height maps have walls at their holes and rims [m]; above all ground: none.
  virtual double bottom() const = 0;
  // Returns the depth of these walls below the samples [m], if they do not end at the bottom before.
  virtual double depth() const { return INFINITE; }

 protected:
  ~Reach() = default;
};

// Reach of everything, for callers that need all triangles in a box.
struct Everything final : Reach {
  bool touches(const Vec3&, double) const override { return true; }
  bool is_clear_of(const Bounds&) const override { return false; }
  bool is_outside(const Vec3&, const Vec3&, const Vec3&) const override { return true; }
  double bottom() const override { return 1e300; }
};

// Adds the facets of those cells of a window that are in `reach`, their convex edges and peaks that are, and the walls
// of holes and rims: what is under a map is solid. The window has a ring of samples around its cells. `first_row`,
// `first_column`: of the window in the map, for the names of points.
void add_cells(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch);

}  // namespace smartmesh
