// The ground near one body as a small triangle mesh with its neighbourhoods: what contacts are worked out from.
#pragma once

#include <vector>

#include "vec3.h"
#include "window.h"

namespace smartmesh {

// Triangle of a patch, counterclockwise seen from its outside. `normal`: unit, outwards.
struct Facet {
  int corner[3];
  Vec3 normal;
};

// Convex edge of a patch. `opposite`: the third corners of the facets at both sides; -1 = no facet. Where more than two
// facets meet, the outermost two.
struct Edge {
  int end[2];
  int opposite[2];
  // Mean of the normals of its facets, not of unit length; zero for meshes, whose outside is where the body is.
  Vec3 outward;

  bool is_of_mesh() const { return !(norm2(outward) > 0.0); }
};

// A point of a patch where the ground is convex, and its neighbours.
struct Peak {
  int point;
  int first, count;  // of its neighbours in `Patch::neighbours`
};

struct Patch {
  std::vector<Vec3> points;
  std::vector<Facet> facets;  // of height maps: what is under them is below the ground
  std::vector<Facet> sheets;  // of meshes: they are touched from both sides
  std::vector<Edge> edges;
  std::vector<Peak> peaks;
  std::vector<int> neighbours;
  std::vector<long> names;  // of points, equal from step to step; edges and facets are named by their points

  void clear() {
    points.clear(), facets.clear(), sheets.clear(), edges.clear(), peaks.clear(), neighbours.clear(), names.clear();
  }
};

// Decides whether a part of the ground may be touched: a ball around `centre` that contains it.
struct Reach {
  virtual bool touches(const Vec3& centre, double radius) const = 0;

 protected:
  ~Reach() = default;
};

// Reach of everything, for callers that need all facets in a box.
struct Everything final : Reach {
  bool touches(const Vec3&, double) const override { return true; }
};

// Adds the facets, convex edges and peaks of those cells of a window that are in `reach`. The window has a ring of
// samples around its cells. `first_row`, `first_column`: of the window in the map, for the names of points.
void add_cells(const Window& window, long first_row, long first_column, const Reach& reach, Patch& patch);

}  // namespace smartmesh
