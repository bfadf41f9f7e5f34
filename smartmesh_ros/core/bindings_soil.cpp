// What Python sees of soil.
#include "bindings.h"

namespace smartmesh {

void add_soil(nb::module_&) {}

}  // namespace smartmesh
