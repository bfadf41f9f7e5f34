// Keeps steps of PyBullet and changes of the ground apart. A server with a window steps in a thread of its own, at any
// moment after `setRealTimeSimulation(1)`.
#pragma once

#include <mutex>

namespace smartmesh {

// Held during each step, and by each function that changes what steps read. Whoever holds it may call neither Python
// nor PyBullet: Python would let another thread run, and PyBullet would wait for the step.
inline std::recursive_mutex& step_mutex() {
  static std::recursive_mutex mutex;
  return mutex;
}

struct StepLock {
  std::unique_lock<std::recursive_mutex> held{step_mutex()};
};

}  // namespace smartmesh
