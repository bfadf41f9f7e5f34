// Search for the contacts of a shape with the ground near it.
#pragma once

#include <vector>

#include "contact/contact.h"
#include "ground/tiles.h"

namespace smartmesh {

// Its memory serves one search after the other.
struct ContactSearch {
  // Replaces `contacts` by those of a shape at `pose` with the ground at `time` [s]; none if a number is not finite.
  // `thickness` [m]: of height maps at their holes and rims. `soil`: is left out.
  void run(const Convex& shape, const Pose& pose, Tiles& tiles, double time, Approach approach,
           std::vector<Contact>& contacts, double thickness = INFINITE, const SoilBelow& soil = {});
  // Finds the angular velocity of the ground at contacts of the last search, but for those on decks.
  void find_rotations(std::vector<Contact>& contacts) const;

  Patch maps, meshes;  // the ground that the last search found
};

}  // namespace smartmesh
