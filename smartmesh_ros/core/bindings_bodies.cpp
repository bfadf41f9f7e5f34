// What Python sees of shapes of bodies, and the ground near them.
#include "bindings.h"

namespace smartmesh {

void add_bodies(nb::module_&) {}

}  // namespace smartmesh
