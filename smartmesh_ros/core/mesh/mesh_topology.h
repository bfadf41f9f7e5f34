// How the triangles of a mesh hang together, whether or not they share their vertices.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "math/vec3.h"

namespace smartmesh {

// An edge and the third corners of all its facets, `MeshTopology::opposite[first]` to `opposite[first + count - 1]`.
struct MeshEdge {
  int end[2];
  int first, count;
};

// Lists of whole numbers, one after the other: list k is `items[start[k]]` to `items[start[k + 1] - 1]`.
struct Lists {
  std::vector<int> start, items;

  const int* begin(int k) const { return items.data() + start[k]; }
  const int* end(int k) const { return items.data() + start[k + 1]; }
};

// A vertex that lies on the segment between `ends`, or at their place if both are one vertex.
struct Joint {
  int vertex, ends[2];
};

// Vertices at one place count as one, the first of them. An edge is divided where vertices of other facets lie on it,
// so that parts which only abut have common edges.
struct MeshTopology {
  std::vector<std::array<int, 3>> facets;  // corners; facets without area are left out
  std::vector<MeshEdge> edges;
  std::vector<int> opposite;
  Lists edges_of;    // a facet
  Lists neighbours;  // of a vertex: where the edges and facets at it lead
  std::vector<Joint> joints;
  double tolerance = 0.0;  // distance up to which places are the same [m]
};

MeshTopology topology_of(const std::vector<Vec3>& points, const std::int64_t* triangles, int count);

// Returns true if all joints still hold after the vertices have moved.
bool holds_together(const MeshTopology& mesh, const std::vector<Vec3>& points);

}  // namespace smartmesh
