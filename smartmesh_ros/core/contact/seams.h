// Seams between pieces of ground: the height maps, each mesh, and those of each deck. A piece has edges and walls at
// its rim. Where another piece continues it, they lie inside the common surface, and a shape slides past them.
#pragma once

#include <vector>

#include "contact/contact_search.h"

namespace smartmesh {

class Seams {
 public:
  void clear() { facets_.clear(); }
  // Adds the ground of a deck that a search has found; `frame`: of the deck in that of the contacts.
  void add(const ContactSearch& search, const Pose& frame);
  // Removes the contacts with rims that another piece hides, or continues in one plane. `beside`: the last search of
  // other ground than decks. `inside`: a point inside the shape [m].
  void remove_hidden(const ContactSearch& beside, const Vec3& inside, std::vector<Contact>& contacts);

 private:
  struct PieceFacet {
    Vec3 corner[3], normal;
    int piece;
  };

  int pieces() const { return facets_.empty() ? 0 : facets_.back().piece; }
  void add(const Patch& patch, const Pose& frame);
  // `deepest` [m]: depth of a point of the shape below any piece.
  bool is_hidden_by(const PieceFacet& facet, const Vec3& inside, double deepest, const Contact& contact) const;

  // Returns true if a contact is with a rim, and all ground around it is in one plane.
  bool is_inside_plane(const Contact& contact) const;

  std::vector<PieceFacet> facets_;  // piece by piece, numbered from 1
};

}  // namespace smartmesh
