// What Python sees of tables of bodies: states, sleep and distances.
#include "bindings.h"

namespace smartmesh {

void add_rows(nb::module_&) {}

}  // namespace smartmesh
