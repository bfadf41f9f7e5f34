// Bodies that are moved without physics: with corrections of the ground, or back onto it.
#pragma once

#include <vector>

#include "bullet/attached.h"
#include "bullet/instant.h"

namespace smartmesh {

// Returns true if a body moves with the maps of a deck, or with those beside decks if `ground` is null, at the instant
// of `reader`: it is over or in them, or on a deck that is carried by a body which moves with them. A body over a mesh,
// or without contacts with the ground over an object without mass, does not move with the maps below these.
bool is_borne_by(const Deck* ground, const Slot& slot, GroundReader& reader, const Instant& now, Attached& attached);

// Moves what lies on ground that a correction moves. A body that lay on it lies on it again, at the same velocity. A
// robot moves as a whole, by the ground under the links that touch it.
void move_with_corrections(const Instant& now, Attached& attached);

// Returns the slots whose bodies are below the ground, of those that are lifted out of it.
std::vector<int> find_below(const Instant& now, Attached& attached);

// Puts bodies onto the ground that are below it, of those in some slots: they were spawned or teleported there, covered
// by a map, or pushed there by another body. Returns PyBullet's numbers of them.
std::vector<int> lift_bodies(const Instant& now, Attached& attached, const std::vector<int>& slots);

}  // namespace smartmesh
