// What Python sees of queries of the ground: heights, facets and rays.
#include "bindings.h"

namespace smartmesh {

void add_queries(nb::module_&) {}

}  // namespace smartmesh
