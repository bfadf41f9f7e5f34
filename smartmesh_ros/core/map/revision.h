// The one counter of changes of the ground.
#pragma once

#include <atomic>

namespace smartmesh {

// The number of the last change of any map.
inline std::atomic<long>& last_revision() {
  static std::atomic<long> last{0};
  return last;
}

// Returns a number higher than all before. Whatever changes takes one, so that whoever has seen a number knows whether
// it has seen the change.
inline long next_revision() { return ++last_revision(); }

}  // namespace smartmesh
