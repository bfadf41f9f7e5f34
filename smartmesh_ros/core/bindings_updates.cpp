// What Python sees of taking maps: motion, fusion and corrections.
#include "bindings.h"

namespace smartmesh {

void add_updates(nb::module_&) {}

}  // namespace smartmesh
