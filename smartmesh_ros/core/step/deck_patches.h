// Patches of the bodies on a deck: found in the deck's frame, and shown in the world as triangles.
#pragma once

#include <vector>

#include "ground/deck.h"
#include "step/shown_patch.h"

namespace smartmesh {

class DeckPatches {
 public:
  // `number`: of the deck.
  DeckPatches(const Deck& deck, int number);
  const Deck& deck() const { return *deck_; }

  // Does what `ShownPatches` does in a search, for bodies as seen from the deck. Others have no patch on it.
  void search(const std::vector<std::int64_t>& slots, const std::vector<ReachingBody>& bodies, std::size_t size,
              double time);
  // Collects the patches of these bodies.
  void collect(double time);
  // Returns the patch of a body in the world if it comes before an `other` one: the body touches the deck, or the deck
  // is higher.
  const ShownPatch& first_of(std::size_t slot, const ShownPatch& other) const;

 private:
  void show(const ShownPatch& on, const FrameState& frame, ShownPatch& shown);

  const Deck* deck_;
  int number_;
  ShownPatches patches_;
  std::vector<std::int64_t> slots_;  // of the last search
  std::vector<ShownPatch> shown_;
};

}  // namespace smartmesh
